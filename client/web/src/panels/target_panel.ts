// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { add } from "../geometry/rotation";
import { fromLps, toLps } from "../geometry/pose";
import { formatNumber, parseNumber } from "../planning/numbers";
import { Gizmo } from "../scene/gizmo";
import { type Target, isSameMove } from "../workbench/target_fit";
import { type TargetPlace, placeOfAnchor, placeOfRegion } from "../workbench/target_place";
import type { Workbench } from "../workbench/workbench";
import { button, collapsible, el, newId, throttleToFrame, select } from "./dom";
import { targetAnswer } from "./target_answer";

const MAX_TARGETS = 16;
const FIELDS: readonly [keyof Target["move"], string][] = [["forwardMm", "forward"], ["leftMm", "left"], ["upMm", "up"]];

/** The face that is targeted: points and regions of the skin that are pulled or given a distance, and what bone does for it. */
export function targetPanel(bench: Workbench): HTMLElement {
  const fit = bench.targets;
  const targetGizmo = new TargetGizmo(bench);
  const addTarget = (label: string, place: TargetPlace | null) => {
    if (!bench.showsPlan) bench.notice.value = "Targets need the plan's face: go back to the plan and close the jaw first.";
    else if (place === null) bench.notice.value = `${label}: this skin does not move with the bone; choose a point of the face.`;
    else if (fit.targets.value.length >= MAX_TARGETS) bench.notice.value = `There are ${MAX_TARGETS} targets; remove one first.`;
    else targetGizmo.take(fit.targets.value.length, [...fit.targets.value, { label, place, move: bench.moveAt(place), isAlong: false, isChanged: false }]);
  };
  const point = button("Choose a point", () => {
    const take = (anchor: Parameters<NonNullable<Workbench["picking"]["value"]>["take"]>[0]) => {
      bench.picking.value = null;
      addTarget(`Point ${fit.targets.value.length + 1}`, anchor === null ? null : placeOfAnchor(bench.file, anchor));
    };
    bench.picking.value = { prompt: "Click the point of the skin to move.", kinds: ["skin"], take };
  });
  const regions = bench.file.manifest.skinRegions.map(({ number, label }) => ({ value: number, label }));
  const region = select<number>("or a place", [{ value: 0, label: "choose" }, ...regions], (number) => {
    const label = regions.find(({ value }) => value === number)?.label ?? "";
    if (number !== 0) addTarget(label, placeOfRegion(bench.file, number));
    region.set([{ value: 0, label: "choose" }, ...regions], 0);
  });
  const list = el("div", { class: "targets" });
  fit.targets.watch((targets) => {
    // What is being typed into keeps its field: its number is what was typed.
    if (list.contains(document.activeElement) && list.children.length === targets.length) return;
    list.replaceChildren(...targets.map((_, index) => targetItem(bench, targetGizmo, index)));
  });
  return collapsible("Soft-tissue targets", [
    el("p", { class: "quiet", text: "Choose a point or region of the skin, drag its arrows, or type its movement from pre-op. The planner computes bone movements that reach it." }),
    el("div", { class: "buttons" }, [point]),
    regions.length === 0 ? null : region.element,
    list,
    freedoms(bench),
    targetAnswer(bench),
  ], (isOpen) => targetGizmo.show(isOpen));
}

/** The arrows at the target in the hand, in place of those of the segment. */
class TargetGizmo {
  private readonly gizmo: Gizmo;
  private index = 0;
  private isOpen = false;

  constructor(private readonly bench: Workbench) {
    this.gizmo = new Gizmo(bench.view.stage, bench.view.head, ({ translationMm }) => {
      this.change(this.index, { move: fromLps(translationMm, bench.file.manifest.headFrame) });
    });
    bench.targets.targets.watch(() => this.place());
    bench.comparison.watch(() => this.place());
    bench.bite.watch(() => this.place());
    bench.shown.watch(throttleToFrame(() => bench.showsPlan && bench.targets.follow(bench.moveAt)));
  }

  show(isOpen: boolean): void {
    this.isOpen = isOpen;
    this.place();
  }

  /** This target is in the hand. */
  take(index: number, targets = this.bench.targets.targets.value): void {
    this.index = index;
    this.bench.targets.set(targets);
    this.place();
  }

  change(index: number, part: Partial<Target>): void {
    const targets = this.bench.targets.targets.value;
    this.index = index;
    // Arrows that are let go of where they were taken have moved nothing.
    if (part.move !== undefined && isSameMove(part.move, targets[index].move)) return;
    this.bench.targets.set(targets.map((target, k) => (k === index ? { ...target, ...part, isChanged: true } : target)));
  }

  private place(): void {
    const { targets } = this.bench.targets;
    const target = targets.value[Math.min(this.index, targets.value.length - 1)];
    const isShown = this.isOpen && target !== undefined && this.bench.comparison.value === null && this.bench.bite.value === null;
    this.gizmo.hide("target", !isShown);
    this.bench.gizmo.hide("target", isShown);
    const { headFrame } = this.bench.file.manifest;
    this.bench.view.setPoints("target", isShown ? targets.value.map(({ place, move }) => add(place.drawnMm, toLps(move, headFrame))) : []);
    if (isShown && !this.gizmo.isDragging) {
      this.gizmo.place({ pivotMm: target.place.drawnMm, translationMm: toLps(target.move, headFrame), rotationVector: [0, 0, 0], scale: 1 });
    }
  }
}

function targetItem(bench: Workbench, targetGizmo: TargetGizmo, index: number): HTMLElement {
  const target = () => bench.targets.targets.value[index];
  const fields = FIELDS.map(([key, label]) => {
    const id = newId("target");
    const input = el("input", { id, attributes: { type: "text", inputmode: "decimal", autocomplete: "off" } });
    input.value = formatNumber(target().move[key]);
    input.addEventListener("change", () => {
      const value = parseNumber(input.value, "mm");
      input.setAttribute("aria-invalid", String(value === null));
      if (value === null) bench.notice.value = `“${input.value}”: enter a number in millimeters.`;
      else targetGizmo.change(index, { move: { ...target().move, [key]: value } });
    });
    return el("span", { class: "target-field" }, [el("label", { text: label, attributes: { for: id } }), input]);
  });
  const along = el("input", { attributes: { type: "checkbox" }, on: { change: () => targetGizmo.change(index, { isAlong: along.checked }) } });
  along.checked = target().isAlong;
  const others = () => bench.targets.targets.value.filter((_, k) => k !== index);
  const { label } = target();
  return el("div", { attributes: { role: "group", "aria-label": `Target for ${label}` } }, [
    el("div", { class: "target-head" }, [
      el("strong", { text: label }),
      button("Pull", () => targetGizmo.take(index), { attributes: { "aria-label": `Pull ${label}` } }),
      button("Remove", () => bench.targets.set(others()), { attributes: { "aria-label": `Remove the target for ${label}` } }),
    ]),
    el("div", { class: "target-fields" }, [...fields, el("span", { class: "unit", text: "mm" })]),
    el("label", { class: "inline" }, [along, "Constrain along this direction only"]),
  ]);
}

/** Which segments may move. */
function freedoms(bench: Workbench): HTMLElement {
  const box = (label: string, isChecked: boolean, onChange: (isChecked: boolean) => void) => {
    const input = el("input", { attributes: { type: "checkbox" }, on: { change: () => onChange(input.checked) } });
    input.checked = isChecked;
    return el("label", { class: "inline" }, [input, label]);
  };
  const update = () => void bench.targets.update();
  const handles = bench.plan.handles.map(({ name, label }) =>
    box(label, true, (isFree) => {
      if (isFree) bench.targets.free.add(name);
      else bench.targets.free.delete(name);
      update();
    }),
  );
  const symmetric = box("stay in the middle", false, (isOn) => {
    bench.targets.isSymmetric = isOn;
    update();
  });
  return el("fieldset", {}, [el("legend", { text: "May move" }), ...handles, symmetric]);
}
