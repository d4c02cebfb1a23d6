// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type MoveKey } from "../geometry/pose";
import { type Unit, formatNumber, parseNumber } from "../planning/numbers";
import { pivotChoices } from "../planning/pivots";
import { MOVE_KEYS } from "../planning/plan";
import type { Head } from "../scene/head";
import { cssColor, segmentColor } from "../scene/materials";
import type { Workbench } from "../workbench/workbench";
import { posesOfCase } from "../planning/plan";
import { button, el, newId, throttleToFrame, section, select } from "./dom";

interface RowText {
  label: string;
  hint: string;
  unit: Unit;
}

export const MOVE_TEXTS: Record<MoveKey, RowText> = {
  forwardMm: { label: "Forward", hint: "− back", unit: "mm" },
  leftMm: { label: "Left", hint: "− right", unit: "mm" },
  upMm: { label: "Up", hint: "− down", unit: "mm" },
  pitchDeg: { label: "Pitch", hint: "+ chin up", unit: "°" },
  rollDeg: { label: "Roll", hint: "+ left side down", unit: "°" },
  yawDeg: { label: "Yaw", hint: "+ to the left", unit: "°" },
};

const STEP = 0.5;
const SMALL_STEP = 0.1;

/** Whose segments are moved: the planner's, or those of another plan of the case. */
export type SegmentsOwner = Pick<Workbench, "plan" | "file" | "selected" | "notice" | "penetrations"> & { view: { head: Pick<Head, "segmentMiddle"> } };

/** Which segment is in the hand, and its move in six numbers: typed, by slider or by arrow keys. */
export function segmentsPanel(bench: SegmentsOwner): HTMLElement {
  const { plan } = bench;
  const undo = button("Undo", () => plan.undo(), { attributes: { title: "Ctrl+Z" } });
  const redo = button("Redo", () => plan.redo(), { attributes: { title: "Ctrl+Y" } });
  const reset = button("Reset", () => plan.reset(bench.selected.value), { attributes: { title: "Reset this segment" } });
  const planned = button("Plan’s pose", () => plan.setPoses(posesOfCase(bench.file)), { attributes: { title: "Reset all segments to the case’s plan" } });
  plan.onChange(() => {
    undo.disabled = !plan.canUndo;
    redo.disabled = !plan.canRedo;
  });
  undo.disabled = redo.disabled = true;
  return section("Segments", [
    segmentList(bench),
    el("div", { class: "rows" }, MOVE_KEYS.map((key) => moveRow(bench, key))),
    pivotField(bench),
    el("div", { class: "buttons" }, [undo, redo, reset, planned]),
    penetrationText(bench),
  ]);
}

function segmentList(bench: SegmentsOwner): HTMLElement {
  const items = bench.plan.handles.map((handle, index) => {
    const swatch = el("span", { class: "swatch" });
    swatch.style.background = cssColor(segmentColor(index));
    const item = el("button", { attributes: { type: "button" }, on: { click: () => (bench.selected.value = index) } }, [swatch, handle.label]);
    bench.selected.watch((selected) => item.setAttribute("aria-pressed", String(selected === index)));
    return item;
  });
  return el("div", { class: "segments", attributes: { role: "group", "aria-label": "Segment" } }, items);
}

function moveRow(bench: SegmentsOwner, key: MoveKey): HTMLElement {
  const { label, hint, unit } = MOVE_TEXTS[key];
  const id = newId("move");
  const number = el("input", { id, attributes: { type: "text", inputmode: "decimal", autocomplete: "off", "aria-describedby": `${id}-hint` } });
  const slider = el("input", { attributes: { type: "range", step: String(SMALL_STEP), "aria-label": `${label} by slider` } });
  const selected = () => bench.selected.value;
  const change = (value: number, isFinal: boolean) => bench.plan.change(selected(), { [key]: value }, isFinal);
  const show = () => {
    const value = bench.plan.moves[selected()][key];
    const limit = bench.plan.limit(selected(), key);
    slider.min = String(-limit);
    slider.max = String(limit);
    slider.value = String(value);
    if (document.activeElement !== number || !number.classList.contains("editing")) number.value = formatNumber(value);
    slider.setAttribute("aria-valuetext", `${formatNumber(value)} ${unit === "mm" ? "millimetres" : "degrees"}`);
  };
  const enter = () => {
    if (!number.classList.contains("editing")) return;
    number.classList.remove("editing");
    const value = parseNumber(number.value, unit);
    number.setAttribute("aria-invalid", String(value === null));
    if (value === null) bench.notice.value = `“${number.value}”: enter a number in ${unit === "mm" ? "millimeters" : "degrees"}.`;
    else if (!change(value, true)) {
      bench.notice.value = `${bench.plan.handles[selected()].label}: ${label.toLowerCase()} is limited to ${formatNumber(bench.plan.limit(selected(), key))} ${unit}.`;
    }
    show();
  };
  number.addEventListener("input", () => number.classList.add("editing"));
  number.addEventListener("change", enter);
  number.addEventListener("focus", () => number.select());
  number.addEventListener("keydown", (event) => {
    const direction = event.key === "ArrowUp" ? 1 : event.key === "ArrowDown" ? -1 : 0;
    if (event.key === "Enter") enter();
    if (event.key === "Escape") {
      number.classList.remove("editing");
      show();
    }
    if (direction === 0) return;
    event.preventDefault();
    enter();
    change(bench.plan.moves[selected()][key] + direction * (event.shiftKey ? SMALL_STEP : STEP), true);
  });
  slider.addEventListener("input", () => change(slider.valueAsNumber, false));
  slider.addEventListener("change", () => change(slider.valueAsNumber, true));
  bench.selected.watch(show);
  bench.plan.onChange(throttleToFrame(show));
  const text = el("label", { attributes: { for: id } }, [label, el("small", { id: `${id}-hint`, text: hint })]);
  return el("div", { class: "move" }, [text, slider, number, el("span", { class: "unit", text: unit })]);
}

function pivotField(bench: SegmentsOwner): HTMLElement {
  const choices = () => {
    const handle = bench.plan.handles[bench.selected.value];
    return pivotChoices(handle, bench.file.manifest.landmarks, bench.view.head.segmentMiddle(handle.name));
  };
  const field = select("Rotation center", choices(), (point) => bench.plan.setPivot(bench.selected.value, point));
  const show = () => {
    const points = choices();
    const pivot = bench.plan.pivot(bench.selected.value);
    field.set(points, Math.max(0, points.findIndex((choice) => choice.value === pivot)));
  };
  bench.selected.watch(show);
  bench.plan.onChange((_, { isFinal }) => {
    if (isFinal) show();
  });
  return field.element;
}

function penetrationText(bench: SegmentsOwner): HTMLElement {
  const text = el("p", { class: "warning", attributes: { role: "status" } });
  bench.penetrations.watch((found) => {
    text.hidden = found.length === 0;
    text.textContent = found
      .map(({ segment, other, depthMm }) => `${segment} overlaps ${other} by up to ${formatNumber(depthMm)} mm.`)
      .join(" ");
  });
  return text;
}
