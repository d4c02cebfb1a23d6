// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { add } from "../geometry/rotation";
import { fromLps, toLps } from "../geometry/pose";
import { formatNumber, parseNumber } from "../planning/numbers";
import { Gizmo } from "../scene/gizmo";
import { type Wish, isSameMove } from "../workbench/wish_fit";
import { type WishPlace, placeOfAnchor, placeOfRegion } from "../workbench/wish_place";
import type { Workbench } from "../workbench/workbench";
import { button, collapsible, el, newId, onceAPicture, select } from "./dom";
import { wishAnswer } from "./wish_answer";

const MOST_WISHES = 16;
const FIELDS: readonly [keyof Wish["move"], string][] = [["forwardMm", "forward"], ["leftMm", "left"], ["upMm", "up"]];

/** The face that is wished for: points and regions of the skin that are pulled or told how far to go, and what bone does for it. */
export function wishPanel(bench: Workbench): HTMLElement {
  const fit = bench.wishes;
  const puller = new Puller(bench);
  const addWish = (label: string, place: WishPlace | null) => {
    if (!bench.showsPlan) bench.notice.value = "Wishes are for the plan's face: go back to the plan, and close the jaw, first.";
    else if (place === null) bench.notice.value = `${label}: this skin does not move with the bone; choose a point of the face.`;
    else if (fit.wishes.value.length >= MOST_WISHES) bench.notice.value = `There are ${MOST_WISHES} wishes; remove one first.`;
    else puller.take(fit.wishes.value.length, [...fit.wishes.value, { label, place, move: bench.moveAt(place), isAlong: false, isChanged: false }]);
  };
  const point = button("Choose a point", () => {
    const take = (anchor: Parameters<NonNullable<Workbench["picking"]["value"]>["take"]>[0]) => {
      bench.picking.value = null;
      addWish(`Point ${fit.wishes.value.length + 1}`, anchor === null ? null : placeOfAnchor(bench.file, anchor));
    };
    bench.picking.value = { prompt: "Click the point of the skin that is to go elsewhere.", kinds: ["skin"], take };
  });
  const regions = bench.file.manifest.skinRegions.map(({ number, label }) => ({ value: number, label }));
  const region = select<number>("or a place", [{ value: 0, label: "choose" }, ...regions], (number) => {
    const label = regions.find(({ value }) => value === number)?.label ?? "";
    if (number !== 0) addWish(label, placeOfRegion(bench.file, number));
    region.set([{ value: 0, label: "choose" }, ...regions], 0);
  });
  const list = el("div", { class: "wishes" });
  fit.wishes.watch((wishes) => {
    // What is being typed into keeps its field: its number is what was typed.
    if (list.contains(document.activeElement) && list.children.length === wishes.length) return;
    list.replaceChildren(...wishes.map((_, index) => wishItem(bench, puller, index)));
  });
  return collapsible("Wished-for face", [
    el("p", { class: "quiet", text: "Choose a point or a place of the skin; pull it by its arrows, or type how far from rest it is to be. Bone moves so that the face comes there." }),
    el("div", { class: "buttons" }, [point]),
    regions.length === 0 ? null : region.element,
    list,
    freedoms(bench),
    wishAnswer(bench),
  ], (isOpen) => puller.show(isOpen));
}

/** The arrows at the wish in the hand, in place of those of the segment. */
class Puller {
  private readonly gizmo: Gizmo;
  private index = 0;
  private isOpen = false;

  constructor(private readonly bench: Workbench) {
    this.gizmo = new Gizmo(bench.view.stage, bench.view.head, ({ translationMm }) => {
      this.change(this.index, { move: fromLps(translationMm, bench.file.manifest.headFrame) });
    });
    bench.wishes.wishes.watch(() => this.place());
    bench.comparison.watch(() => this.place());
    bench.bite.watch(() => this.place());
    bench.shown.watch(onceAPicture(() => bench.showsPlan && bench.wishes.follow(bench.moveAt)));
  }

  show(isOpen: boolean): void {
    this.isOpen = isOpen;
    this.place();
  }

  /** This wish is in the hand. */
  take(index: number, wishes = this.bench.wishes.wishes.value): void {
    this.index = index;
    this.bench.wishes.set(wishes);
    this.place();
  }

  change(index: number, part: Partial<Wish>): void {
    const wishes = this.bench.wishes.wishes.value;
    this.index = index;
    // Arrows that are let go of where they were taken have moved nothing.
    if (part.move !== undefined && isSameMove(part.move, wishes[index].move)) return;
    this.bench.wishes.set(wishes.map((wish, k) => (k === index ? { ...wish, ...part, isChanged: true } : wish)));
  }

  private place(): void {
    const { wishes } = this.bench.wishes;
    const wish = wishes.value[Math.min(this.index, wishes.value.length - 1)];
    const isShown = this.isOpen && wish !== undefined && this.bench.comparison.value === null && this.bench.bite.value === null;
    this.gizmo.hide("wish", !isShown);
    this.bench.gizmo.hide("wish", isShown);
    const { headFrame } = this.bench.file.manifest;
    this.bench.view.setPoints("wish", isShown ? wishes.value.map(({ place, move }) => add(place.drawnMm, toLps(move, headFrame))) : []);
    if (isShown && !this.gizmo.isDragging) {
      this.gizmo.place({ pivotMm: wish.place.drawnMm, translationMm: toLps(wish.move, headFrame), rotationVector: [0, 0, 0], scale: 1 });
    }
  }
}

function wishItem(bench: Workbench, puller: Puller, index: number): HTMLElement {
  const wish = () => bench.wishes.wishes.value[index];
  const fields = FIELDS.map(([key, label]) => {
    const id = newId("wish");
    const input = el("input", { id, attributes: { type: "text", inputmode: "decimal", autocomplete: "off" } });
    input.value = formatNumber(wish().move[key]);
    input.addEventListener("change", () => {
      const value = parseNumber(input.value, "mm");
      input.setAttribute("aria-invalid", String(value === null));
      if (value === null) bench.notice.value = `“${input.value}” is no number of millimetres.`;
      else puller.change(index, { move: { ...wish().move, [key]: value } });
    });
    return el("span", { class: "wish-field" }, [el("label", { text: label, attributes: { for: id } }), input]);
  });
  const along = el("input", { attributes: { type: "checkbox" }, on: { change: () => puller.change(index, { isAlong: along.checked }) } });
  along.checked = wish().isAlong;
  const others = () => bench.wishes.wishes.value.filter((_, k) => k !== index);
  const { label } = wish();
  return el("div", { attributes: { role: "group", "aria-label": `Wish for ${label}` } }, [
    el("div", { class: "wish-head" }, [
      el("strong", { text: label }),
      button("Pull", () => puller.take(index), { attributes: { "aria-label": `Pull ${label}` } }),
      button("Remove", () => bench.wishes.set(others()), { attributes: { "aria-label": `Remove the wish for ${label}` } }),
    ]),
    el("div", { class: "wish-fields" }, [...fields, el("span", { class: "unit", text: "mm" })]),
    el("label", { class: "inline" }, [along, "only along this, across it as it will"]),
  ]);
}

/** Which segments may move. */
function freedoms(bench: Workbench): HTMLElement {
  const box = (label: string, isChecked: boolean, onChange: (isChecked: boolean) => void) => {
    const input = el("input", { attributes: { type: "checkbox" }, on: { change: () => onChange(input.checked) } });
    input.checked = isChecked;
    return el("label", { class: "inline" }, [input, label]);
  };
  const update = () => void bench.wishes.update();
  const handles = bench.plan.handles.map(({ name, label }) =>
    box(label, true, (isFree) => {
      if (isFree) bench.wishes.free.add(name);
      else bench.wishes.free.delete(name);
      update();
    }),
  );
  const symmetric = box("stay in the middle", false, (isOn) => {
    bench.wishes.isSymmetric = isOn;
    update();
  });
  return el("fieldset", {}, [el("legend", { text: "May move" }), ...handles, symmetric]);
}
