// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { messageOf } from "../calls/call_error";
import type { Prediction } from "../generated/tissueform/v1/prediction_pb";
import type { Comparison } from "../workbench/comparison";
import { exportText, maySend, mayTakeBack } from "../workbench/pacs_exports";
import type { Workbench } from "../workbench/workbench";
import { type Choice, button, el, newId, section, select, slider, whileBusy } from "./dom";
import { modelText } from "./maps_panel";

const MOST_TITLE = 120;

/** Predictions of the case: stored under a name, listed, and laid beside each other by a slider. */
export function predictionsPanel(bench: Workbench): HTMLElement {
  return section("Predictions", [storeForm(bench), predictionList(bench), comparisonBox(bench)]);
}

function storeForm(bench: Workbench): HTMLElement {
  const id = newId("title");
  const title = el("input", { id, attributes: { type: "text", maxlength: String(MOST_TITLE), placeholder: "Name, e.g. Jaw 8 mm forward", autocomplete: "off" } });
  const store = el("button", { text: "Store", attributes: { type: "submit" } });
  const form = el("form", { class: "store" }, [el("label", { class: "hidden", text: "Name of the prediction", attributes: { for: id } }), title, store]);
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const run = async () => {
      bench.notice.value = "The server computes the full solution and stores it.";
      const prediction = await bench.stored.store(title.value.trim() === "" ? defaultTitle(bench) : title.value.trim());
      title.value = "";
      bench.notice.value = `Stored “${prediction.title}”.`;
    };
    void whileBusy(store, run, (thrown) => (bench.notice.value = messageOf(thrown)));
  });
  return form;
}

function defaultTitle(bench: Workbench): string {
  return `Prediction ${bench.stored.all.value.length + 1}`;
}

function predictionList(bench: Workbench): HTMLElement {
  const list = el("ul", { class: "predictions" });
  const show = () => {
    const compared = bench.comparison.value?.to.name;
    const items = bench.stored.all.value.map((prediction) => predictionItem(bench, prediction, prediction.name === compared));
    list.replaceChildren(...items);
    if (items.length === 0) list.append(el("li", { class: "quiet", text: "No stored predictions yet." }));
  };
  bench.stored.all.watch(show);
  bench.pacs.byPrediction.watch(show);
  bench.comparison.watch((next) => {
    // While the slider moves the list stays as it is: what has the focus keeps it.
    const shown = list.querySelector("[aria-pressed=true]")?.getAttribute("data-name") ?? undefined;
    if (shown !== next?.to.name) show();
  });
  return list;
}

function predictionItem(bench: Workbench, prediction: Prediction, isCompared: boolean): HTMLElement {
  const info = bench.modelInfo(prediction.model);
  const seconds = Number(prediction.createTime?.seconds ?? 0n);
  const facts = [info === undefined ? "" : modelText(info.name).label, seconds === 0 ? "" : new Date(1000 * seconds).toLocaleString()];
  const text = el("span", {}, [el("strong", { text: prediction.title || "Untitled" }), el("small", { text: facts.filter((fact) => fact !== "").join(" · ") })]);
  const onError = (thrown: unknown) => (bench.notice.value = messageOf(thrown));
  const toggle = async () => bench.compare(isCompared ? null : { from: "plan", to: prediction, share: 1 });
  const compare = button("Compare", () => void whileBusy(compare, toggle, onError), {
    attributes: { "aria-pressed": String(isCompared), "data-name": prediction.name, "aria-label": `Compare ${prediction.title}` },
  });
  const remove = button("Delete", () => void whileBusy(remove, () => bench.stored.remove(prediction), onError), {
    attributes: { "aria-label": `Delete ${prediction.title}` },
  });
  return el("li", {}, [text, compare, remove, pacsLine(bench, prediction)]);
}

/** Null where the server sends nothing to a PACS. */
function pacsLine(bench: Workbench, prediction: Prediction): HTMLElement | null {
  const all = bench.pacs.byPrediction.value;
  if (all === null) return null;
  const entry = all.get(prediction.name);
  const onError = (thrown: unknown) => (bench.notice.value = messageOf(thrown));
  const send = button("Send to PACS", () => void whileBusy(send, () => bench.stored.send(prediction), onError), {
    attributes: { "aria-label": `Send ${prediction.title} to the PACS` },
  });
  const withdraw = async () => (mayTakeBack(entry) ? bench.pacs.takeBack(entry) : undefined);
  const takeBack = button("Withdraw", () => void whileBusy(takeBack, withdraw, onError), {
    attributes: { "aria-label": `Withdraw ${prediction.title} from the PACS` },
  });
  return el("div", { class: "pacs" }, [
    entry === undefined ? null : el("small", { text: `PACS: ${exportText(entry)}`, attributes: { role: "status" } }),
    maySend(entry) ? send : null,
    mayTakeBack(entry) ? takeBack : null,
  ]);
}

function comparisonBox(bench: Workbench): HTMLElement {
  const update = (part: Partial<Comparison>) => {
    const now = bench.comparison.value;
    if (now !== null) bench.compare({ ...now, ...part }).catch((thrown) => (bench.notice.value = messageOf(thrown)));
  };
  const from = select<Comparison["from"]>("From", [], (value) => update({ from: value }));
  const share = slider("Blend between the two", { least: 0, most: 1, step: 0.01, value: 1 }, (value) => update({ share: value }));
  const ends = el("div", { class: "ticks" });
  const box = el("div", { class: "comparison", attributes: { role: "group", "aria-label": "Comparison" } }, [
    from.element,
    share,
    ends,
    button("Back to the plan", () => void bench.compare(null)),
  ]);
  bench.comparison.watch((comparison) => {
    box.hidden = comparison === null;
    if (comparison === null) return;
    const choices = fromChoices(bench, comparison.to);
    const index = choices.findIndex(({ value }) => value === comparison.from);
    from.set(choices, Math.max(0, index));
    share.value = String(comparison.share);
    ends.replaceChildren(el("span", { text: choices[Math.max(0, index)].label }), el("span", { text: comparison.to.title }));
  });
  return box;
}

function fromChoices(bench: Workbench, to: Prediction): Choice<Comparison["from"]>[] {
  const others = bench.stored.all.value.filter((prediction) => prediction.name !== to.name);
  return [
    { value: "plan", label: "The plan now" },
    { value: "rest", label: "Pre-op face" },
    ...others.map((prediction) => ({ value: prediction, label: prediction.title })),
  ];
}
