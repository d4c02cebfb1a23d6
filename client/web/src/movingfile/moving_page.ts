// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { VIRIDIS } from "../geometry/color_map";
import type { MoveKey } from "../geometry/pose";
import { button, el, newId, throttleToFrame, section, slider } from "../panels/dom";
import { PictureBox } from "../panels/picture_box";
import { viewBar } from "../panels/view_bar";
import { formatNumber, formatWithUnit } from "../planning/numbers";
import { MOVE_KEYS } from "../planning/plan";
import { cssColor, segmentColor } from "../scene/materials";
import type { MovingData } from "../movingdata/moving_data";
import type { Engine } from "./engine";
import { MovingHead, type NotShown, type Shown } from "./moving_head";

const LABELS: Record<MoveKey, string> = {
  forwardMm: "Forward",
  leftMm: "Left",
  upMm: "Up",
  pitchDeg: "Pitch",
  rollDeg: "Roll",
  yawDeg: "Yaw",
};

const MODELS: Record<string, string> = {
  gradient_field: "gradient field",
  linear_elastic: "linear elastic",
  neo_hookean: "neo-Hookean",
};

const NOT_SHOWN: Record<NotShown, string> = {
  beyond: "Outside the prepared range: the picture shows the last movement within it.",
  failed: "This movement could not be computed: the picture shows an older one. If this persists, open the file again.",
};

const STEP = 0.1;

/** What is seen once the data are open. */
export async function movingPage(data: MovingData, engine: Engine): Promise<{ element: HTMLElement; head: MovingHead }> {
  const picture = new PictureBox(() => {});
  const head = await MovingHead.make(picture.element, data, engine, picture.listener);
  picture.dress(head.view, "3D view of the head: drag to rotate, use the wheel or two fingers to zoom");
  const legend = legendBox();
  const numbers = numbersPanel(data, head);
  head.onShown = (shown) => {
    numbers.show(shown);
    legend.show(typeof shown === "string" ? null : shown.legend);
  };
  const segments = data.handles.flatMap((handle, index) => (handle.isFree ? [segmentSection(head, index)] : []));
  const panel = el("aside", { attributes: { "aria-label": "Movements" } }, [beforeAfter(head), numbers.element, ...segments]);
  const title = data.title === "" ? null : el("h1", { text: data.title });
  return { element: el("div", { class: "moving" }, [title, el("main", {}, [picture.element, legend.element, viewBar(head.view)]), panel]), head };
}

/** From the face of today to the planned one. */
function beforeAfter(head: MovingHead): HTMLElement {
  const between = slider("From pre-op to post-op (predicted)", { least: 0, most: 1, step: 0.01, value: 1 }, (share) => head.showShare(share));
  const go = (share: number) => {
    between.value = String(share);
    head.showShare(share);
  };
  const colored = el("input", { attributes: { type: "checkbox" }, on: { change: () => head.setColored(colored.checked) } });
  return section("Before and after", [
    el("div", { class: "buttons" }, [button("Before", () => go(0)), button("Planned", () => go(1))]),
    between,
    el("label", { class: "check" }, [colored, "Color by skin movement"]),
    head.photograph === null ? null : photographCheck(head),
  ]);
}

function photographCheck(head: MovingHead): HTMLElement {
  const shown: HTMLInputElement = el("input", {
    attributes: { type: "checkbox", checked: "" },
    on: {
      change: () => {
        head.photograph?.setShown(shown.checked);
        head.view.stage.invalidate();
      },
    },
  });
  return el("label", { class: "check" }, [shown, "Photograph"]);
}

function segmentSection(head: MovingHead, index: number): HTMLElement {
  const { label } = head.data.handles[index];
  const swatch = el("span", { class: "swatch" });
  swatch.style.background = cssColor(segmentColor(index));
  const part = section(label, [...MOVE_KEYS.map((key) => moveRow(head, index, key)), el("div", { class: "buttons" }, [button("Back to pre-op", () => head.plan.reset(index))])]);
  part.querySelector("h2")?.prepend(swatch);
  return part;
}

function moveRow({ plan }: MovingHead, index: number, key: MoveKey): HTMLElement {
  const limit = plan.limit(index, key);
  const unit = key.endsWith("Mm") ? "mm" : "°";
  const id = newId("move");
  const control = slider(LABELS[key], { least: -limit, most: limit, step: STEP, value: 0 }, (value) => plan.change(index, { [key]: value }, true));
  control.id = id;
  control.removeAttribute("aria-label");
  const number = el("output", { attributes: { for: id } });
  const show = () => {
    const value = plan.moves[index][key];
    control.value = String(value);
    number.textContent = formatWithUnit(value, unit);
    number.classList.toggle("warning", Math.abs(value) >= limit - 1e-9);
    number.title = Math.abs(value) >= limit - 1e-9 ? "Limit of this file" : "";
    control.setAttribute("aria-valuetext", number.textContent);
  };
  plan.onChange(throttleToFrame(show));
  show();
  return el("div", { class: "move" }, [el("label", { text: LABELS[key], attributes: { for: id } }), control, number]);
}

function numbersPanel(data: MovingData, head: MovingHead): { element: HTMLElement; show(shown: Shown | NotShown): void } {
  const problem = el("p", { class: "warning", attributes: { role: "status" } });
  const largest = el("p");
  const exactness = el("p", { class: "quiet" });
  const slow = head.isInWorker ? null : el("p", { class: "quiet", text: "This browser gives the file no background thread: it moves more slowly." });
  const element = section("Prediction", [
    problem,
    largest,
    exactness,
    el("p", { class: "quiet", text: `Model: ${MODELS[data.model] ?? data.model}. Made by ${data.software}.` }),
    slow,
  ]);
  const show = onceAPictureWith((shown: Shown | NotShown) => {
    problem.hidden = typeof shown !== "string";
    if (typeof shown === "string") {
      problem.textContent = NOT_SHOWN[shown];
      return;
    }
    largest.textContent = `Largest movement of the skin: ${withBand(shown)}`;
    exactness.textContent = describeError(shown);
  });
  return { element, show };
}

function withBand({ largestMm, band }: Shown): string {
  const number = `${formatNumber(largestMm)} mm`;
  if (band === null) return `${number}. No 95 % interval for this model or pose.`;
  return `${number}, ${formatNumber(band.lowestMm)} to ${formatNumber(band.highestMm)} (95 % interval, stiffness only).`;
}

function describeError({ errorBoundMm, isEstimate }: Shown): string {
  const number = formatNumber(Math.max(errorBoundMm, 0.01), 2);
  return isEstimate ? `Estimate: about ${number} mm from the full answer of the model.` : `Within ${number} mm of the full answer of the model.`;
}

/** Shows the newest of what it is given before the browser's next picture. */
function onceAPictureWith<T>(show: (value: T) => void): (value: T) => void {
  let newest: T | null = null;
  const update = throttleToFrame(() => {
    if (newest !== null) show(newest);
  });
  return (value) => {
    newest = value;
    update();
  };
}

function legendBox(): { element: HTMLElement; show(legend: Shown["legend"]): void } {
  const bar = el("div", { class: "colors", attributes: { role: "img", "aria-label": "Colors from zero to maximum" } });
  bar.style.background = `linear-gradient(to right, ${VIRIDIS.anchors.map((color) => `rgb(${color.join(" ")})`).join(", ")})`;
  const title = el("strong");
  const ticks = el("div", { class: "ticks" });
  const element = el("div", { class: "legend", attributes: { role: "group", "aria-label": "Legend of the map" } }, [title, bar, ticks]);
  element.hidden = true;
  return {
    element,
    show(legend) {
      element.hidden = legend === null;
      if (legend === null) return;
      title.textContent = `${legend.title}, mm`;
      ticks.replaceChildren(...[0, 0.5, 1].map((share) => el("span", { text: formatNumber(share * legend.mostMm, legend.mostMm < 1 ? 2 : 1) })));
    },
  };
}
