// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { messageOf } from "../calls/call_error";
import type { DeformationModel } from "../generated/tissueform/v1/session_pb";
import { VIRIDIS, colorTable } from "../geometry/color_map";
import { formatNumber } from "../planning/numbers";
import type { LocalState } from "../live/local_answers";
import type { MapLegend, ShownLegend } from "../workbench/face_colors";
import type { FaceMap, MapChoice } from "../workbench/face_map";
import { describeFace } from "../workbench/shown_answer";
import type { Workbench } from "../workbench/workbench";
import { type Choice, button, el, newId, throttleToFrame, section, select } from "./dom";

interface ModelText {
  label: string;
  text: string;
}

const MODELS: Record<string, ModelText> = {
  gradient_field: { label: "Gradient field", text: "Geometric, not mechanical: spreads the motion of the bone through the tissue, weighted by its stiffness. Computes no forces. Instant: for a first look while you drag." },
  arap: { label: "As rigid as possible", text: "Keeps each element as near to a rigid motion as it can, weighted by its stiffness: like a corotational elastic solid without Poisson effect. Iterates, so it is slower. For segments that shift without turning." },
  linear_elastic: { label: "Linear elastic", text: "Linear finite elements: Hooke’s law, small strains and rotations. Instant. Valid for moves up to about 5 mm and turns of a few degrees. Provides a 95 % interval." },
  neo_hookean: { label: "Neo-Hookean", text: "Nonlinear finite elements: hyperelastic tissue, large deformations. Shows an estimate while you drag and the full solution when you stop. Provides a 95 % interval." },
};

export function modelText(name: string): ModelText {
  return MODELS[name] ?? { label: name, text: "" };
}

/** Which model answers, in words. `contact`: contactPart. */
export function modelPanel(bench: Workbench, contact: HTMLElement): HTMLElement {
  const name = newId("model");
  const items = bench.models.map((info) => {
    const { label, text } = modelText(info.name);
    const input = el("input", { attributes: { type: "radio", name }, on: { change: () => void bench.chooseModel(info.model) } });
    bench.model.watch((model) => (input.checked = model === info.model));
    return el("label", { class: "model" }, [input, el("span", {}, [el("strong", { text: label }), el("small", { text })])]);
  });
  const answer = el("p", { class: "quiet" });
  const show = () => {
    const text = describeFace(bench.answer.value, bench.comparison.value);
    if (answer.textContent !== text) answer.textContent = text;
  };
  bench.answer.watch(throttleToFrame(show));
  bench.comparison.watch(throttleToFrame(show));
  return section("Model", [el("div", { attributes: { role: "radiogroup", "aria-label": "Model" } }, items), contact, answer, localAnswers(bench)]);
}

/** Who answers the hand, and what stops or starts that. */
function localAnswers(bench: Workbench): HTMLElement {
  const text = el("span", { attributes: { "data-local": "none" } });
  const stop = button("Stop", () => bench.local.stop(), { attributes: { title: "Answers from the server" } });
  const start = button("Answer here", () => bench.local.resume(), { attributes: { title: "Answers computed in this page, without waiting for the server" } });
  const show = () => {
    const state = bench.localState.value;
    const description = describeLocal(state);
    if (text.textContent !== description) text.textContent = description;
    text.dataset.local = state.kind === "ready" ? state.coverage : state.kind;
    stop.hidden = state.kind !== "fetching" && state.kind !== "ready";
    start.hidden = state.kind !== "stopped" && state.kind !== "failed";
  };
  bench.localState.watch(throttleToFrame(show));
  show();
  return el("p", { class: "quiet local" }, [text, " ", stop, start]);
}

export function describeLocal(state: LocalState): string {
  switch (state.kind) {
    case "none":
      return "The server answers.";
    case "fetching":
      return `The server answers. This page is loading its columns: ${Math.round(100 * state.share)} %.`;
    case "stopped":
      return "The server answers.";
    case "failed":
      return `The server answers. This page cannot: ${state.text}`;
    case "ready": {
      if (state.coverage === "beyond") return "Outside the prepared range: the server answers.";
      const slow = state.hasWorkers ? "" : " (without a background thread: slower)";
      return `This page answers at once${slow}; the server confirms.`;
    }
  }
}

/** Which map lies on the skin, and what its colors mean. */
export function mapPanel(bench: Workbench): HTMLElement {
  const choose = (choice: MapChoice) => {
    bench.chooseMap(choice).catch((thrown) => (bench.notice.value = messageOf(thrown)));
  };
  const field = select<MapChoice>("Color by", mapChoices(bench), choose);
  const show = () => {
    const choices = mapChoices(bench);
    field.set(choices, Math.max(0, choices.findIndex((choice) => isSame(choice.value, bench.map.choice.value))));
  };
  bench.map.choice.watch(show);
  bench.model.watch(show);
  bench.stored.all.watch(show);
  return section("Map", [field.element]);
}

function mapChoices(bench: Workbench): Choice<MapChoice>[] {
  const choices: Choice<MapChoice>[] = [
    { value: { kind: "none" }, label: "Skin color" },
    { value: { kind: "movement" }, label: "Movement of the skin" },
  ];
  if (bench.hasBand) choices.push({ value: { kind: "band" }, label: "95 % interval (material)" });
  for (const { model, name } of bench.models) {
    const { label } = modelText(name);
    if (model !== bench.model.value) choices.push({ value: { kind: "model", model, label }, label: `Difference to ${label}` });
  }
  for (const prediction of bench.stored.all.value) {
    choices.push({ value: { kind: "prediction", prediction }, label: `Difference to “${prediction.title}”` });
  }
  return choices;
}

function isSame(a: MapChoice, b: MapChoice): boolean {
  const key = (map: MapChoice): DeformationModel | string => {
    if (map.kind === "model") return map.model;
    return map.kind === "prediction" ? map.prediction.name : "";
  };
  return a.kind === b.kind && key(a) === key(b);
}

const BAR_WIDTH = 256;

/** The legend over the picture, of the skin's map or of the bite: title, colors, range in mm. */
export function legendBox(bench: Pick<Workbench, "bite"> & { map: Pick<FaceMap, "legend"> }): HTMLElement {
  const bar = el("canvas", { attributes: { width: String(BAR_WIDTH), height: "1", role: "img", "aria-label": "Color range" } });
  drawBar(bar);
  const title = el("strong");
  const ticks = el("div", { class: "ticks" });
  const note = el("small");
  const box = el("div", { class: "legend", attributes: { role: "group", "aria-label": "Legend of the map" } }, [title, bar, ticks, note]);
  const show = () => {
    // The skin and its map are not seen beside the teeth alone.
    const legend = bench.bite.value ?? mapLegend(bench.map.legend.value);
    box.hidden = legend === null;
    if (legend === null) return;
    title.textContent = `${legend.title}, mm`;
    const decimals = Math.max(...legend.ticksMm) < 1 ? 2 : 1;
    ticks.replaceChildren(...legend.ticksMm.map((mm) => el("span", { text: formatNumber(mm, decimals) })));
    note.textContent = legend.note;
  };
  bench.map.legend.watch(show);
  bench.bite.watch(show);
  return box;
}

function mapLegend(legend: MapLegend | null): ShownLegend | null {
  return legend === null ? null : { title: legend.title, ticksMm: [0, legend.mostMm / 2, legend.mostMm], note: largestText(legend) };
}

/** "largest 8.12 mm, 95 % interval (stiffness only) 7.50 to 8.80", the second where it is known. */
export function largestText({ largestMm, band }: Pick<MapLegend, "largestMm" | "band">): string {
  const range = band === null ? "" : `, 95 % interval (stiffness only) ${formatNumber(band.lowestMm, 2)} to ${formatNumber(band.highestMm, 2)}`;
  return `largest ${formatNumber(largestMm, 2)} mm${range}`;
}

function drawBar(bar: HTMLCanvasElement): void {
  const context = bar.getContext("2d");
  if (context === null) return;
  const image = context.createImageData(BAR_WIDTH, 1);
  const table = colorTable(VIRIDIS);
  for (let i = 0; i < BAR_WIDTH; ++i) image.data.set([table[3 * i], table[3 * i + 1], table[3 * i + 2], 255], 4 * i);
  context.putImageData(image, 0, 0);
}
