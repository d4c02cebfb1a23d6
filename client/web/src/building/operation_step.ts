// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type MoveKey, type SegmentMove, toMove, toPose } from "../geometry/pose";
import { type Vector, add as sum, apply, fromRotationVector, norm, scaled } from "../geometry/rotation";
import { button, el, newId, renew, section, select } from "../panels/dom";
import type { Unit } from "../planning/numbers";
import { cssColor, segmentColor } from "../scene/materials";
import type { CutAnswer } from "./bone_worker";
import { TEMPLATES, pivotOf, withStartingPlanes, withTemplate } from "./operations";
import type { PlanDraft } from "./plan_draft";
import { type RecipePose, type RecipeSegment, hasPoint, rounded, roundedPlane, withSegment, withSegments } from "./recipe";
import { type Step, numberField, problemBox } from "./step";

const MOVES: readonly { key: MoveKey; label: string; unit: Unit }[] = [
  { key: "forwardMm", label: "Forward", unit: "mm" },
  { key: "upMm", label: "Up", unit: "mm" },
  { key: "leftMm", label: "Left", unit: "mm" },
  { key: "pitchDeg", label: "Pitch", unit: "°" },
  { key: "rollDeg", label: "Roll", unit: "°" },
  { key: "yawDeg", label: "Yaw", unit: "°" },
];

const DEGREE = Math.PI / 180;
const NAME = /^[A-Za-z0-9_-]{1,64}$/;
/** Cuts that come nearer to teeth or the nerve's canal than this are warned of. */
export const DEFAULT_MARGIN_MM = 2;

export interface OperationStep extends Step {
  /** How near cuts may come to teeth and canal, in mm. */
  readonly marginMm: number;
  showPieces(answer: CutAnswer, ms: number): void;
}

/** Segments: what is cut, by which planes, and how it moves. */
export function operationStep(draft: PlanDraft): OperationStep {
  let template = TEMPLATES[0].template;
  let marginMm = DEFAULT_MARGIN_MM;
  let volumes: readonly number[] = [];
  const choice = select("Operation", TEMPLATES.map(({ template: value, label }) => ({ value, label })), (value) => (template = value));
  const add = button("Add", () => {
    const first = draft.recipe.segments.length;
    draft.change(withTemplate(draft.recipe, template, draft.anatomy));
    draft.select(first, null);
  });
  const tabs = el("div", { class: "segments", attributes: { role: "group", "aria-label": "Segments" } });
  const editor = segmentEditor(draft, () => add.focus());
  const pieces = el("p", { class: "quiet pieces", attributes: { role: "status" } });
  const warnings = el("ul", { class: "notes warning", attributes: { "aria-label": "Warnings" } });
  const margin = numberField("Warn when a cut is nearer to teeth or canal than", "mm", (value) => {
    marginMm = Math.max(0, value);
    draft.change(draft.recipe);
  });
  margin.set(marginMm);
  const element = el("div", {}, [
    section("Operation", [choice.element, add, tabs]),
    editor.element,
    section("Cuts", [pieces, warnings, margin.element]),
  ]);
  const update = () => {
    const { segments } = draft.recipe;
    margin.element.hidden = draft.labels === null;
    renew(tabs, segments.map(({ name }, index) => segmentButton(name, index, index === draft.selectedSegment, () => draft.select(index, null))));
    editor.update(volumes);
  };
  return {
    title: "Operation",
    element,
    needsCt: true,
    update,
    get marginMm() {
      return marginMm;
    },
    showPieces(answer, ms) {
      volumes = answer.volumesMm3;
      const { segments } = draft.recipe;
      const cut = segments.flatMap(({ name, planes }, index) => (planes === undefined ? [] : [`${name} ${((volumes[index] ?? 0) / 1000).toFixed(1)} cm³`]));
      pieces.textContent = cut.length === 0 ? "" : `Preview of the pieces: ${cut.join(", ")}. The build separates the jaws in the CT more exactly.`;
      pieces.dataset.ms = ms.toFixed(0);
      pieces.dataset.workerMs = answer.ms.toFixed(0);
      warnings.replaceChildren(...answer.near.map(({ segment, structure, distanceMm }) => el("li", { text: nearText(segments[segment]?.name ?? "", structure, distanceMm) })));
    },
  };
}

export function nearText(segment: string, structure: string, distanceMm: number): string {
  const words = structure === "canal" ? "the canal of the nerve" : `the ${structure.replace("_", " ")}`;
  return distanceMm === 0 ? `A cut of ${segment} passes through ${words}.` : `A cut of ${segment} passes ${distanceMm.toFixed(1)} mm from ${words}.`;
}

function segmentButton(name: string, index: number, isSelected: boolean, onClick: () => void): HTMLElement {
  const swatch = el("span", { class: "swatch" });
  swatch.style.background = cssColor(segmentColor(index));
  return el("button", { attributes: { type: "button", "aria-pressed": String(isSelected) }, on: { click: onClick } }, [swatch, el("span", { text: name })]);
}

/** The chosen segment. `onNone`: the last one was removed, and the fields went with it. */
function segmentEditor(draft: PlanDraft, onNone: () => void): { element: HTMLElement; update(volumes: readonly number[]): void } {
  const problem = problemBox();
  const segment = (): RecipeSegment | undefined => draft.recipe.segments[draft.selectedSegment];
  const change = (part: Partial<RecipeSegment>) => draft.change(withSegment(draft.recipe, draft.selectedSegment, part));
  const nameId = newId("name");
  const name = el("input", { id: nameId, attributes: { type: "text", autocomplete: "off", maxlength: "64" } });
  name.addEventListener("change", () => {
    const isTaken = draft.recipe.segments.some((other, index) => index !== draft.selectedSegment && other.name === name.value);
    problem.show(!NAME.test(name.value) ? "A name has letters, digits, _ and -." : isTaken ? "Another segment has this name." : "");
    if (NAME.test(name.value) && !isTaken) change({ name: name.value });
  });
  const moves = MOVES.map(({ key, label, unit }) => ({ key, field: numberField(label, unit, (value) => setMove({ [key]: value })) }));
  const setMove = (part: Partial<SegmentMove>) => {
    const one = segment();
    if (one === undefined) return;
    const pivot = pivotOf(one, draft.anatomy);
    change({ pose: poseOf({ ...moveOf(one, pivot, draft), ...part }, pivot, draft) });
  };
  const pivotText = el("small");
  const pivotHere = button("Turn about the crosshair", () => {
    const one = segment();
    if (one === undefined) return;
    const pivot = rounded(draft.crosshair);
    change({ pose: poseOf(moveOf(one, pivot, draft), pivot, draft) });
  });
  const dissected = numberField("Tissue lifted off beside the cut", "mm", (value) => change({ dissected_mm: Math.max(0, Math.min(20, value)) }));
  const planes = el("div", { class: "rows" });
  const remove = button("Remove the segment", () => {
    draft.change(withSegments(draft.recipe, draft.recipe.segments.filter((_, index) => index !== draft.selectedSegment)));
    if (draft.recipe.segments.length === 0) onNone();
  });
  const element = section("Segment", [
    el("div", { class: "field" }, [el("label", { text: "Name", attributes: { for: nameId } }), name]),
    problem.element,
    el("div", { class: "rows" }, moves.map(({ field }) => field.element)),
    pivotText,
    pivotHere,
    dissected.element,
    el("h3", { text: "Planes of the cut" }),
    planes,
    remove,
  ]);
  const update = () => {
    const one = segment();
    element.hidden = one === undefined;
    if (one === undefined) return;
    const pivot = pivotOf(one, draft.anatomy);
    const move = moveOf(one, pivot, draft);
    if (document.activeElement !== name) name.value = one.name;
    moves.forEach(({ key, field }) => field.set(move[key]));
    pivotText.textContent = `Turns about (${pivot.map((value) => value.toFixed(1)).join(", ")}) mm.`;
    dissected.set(one.dissected_mm ?? 0);
    renew(planes, planeRows(draft, one));
  };
  return { element, update };
}

function moveOf({ pose = {} }: RecipeSegment, pivot: Vector, draft: PlanDraft): SegmentMove {
  const { translation_mm = [0, 0, 0], rotation_vector_deg = [0, 0, 0], pivot_mm = [0, 0, 0], scale = 1 } = pose;
  return toMove({ translationMm: translation_mm, rotationVector: scaled(rotation_vector_deg, DEGREE), pivotMm: pivot_mm, scale }, pivot, draft.frame);
}

/** A pose that only shifts needs no pivot. */
function poseOf(move: SegmentMove, pivot: Vector, draft: PlanDraft): RecipePose {
  const { rotationVector, translationMm, scale } = toPose(move, pivot, draft.frame);
  const turn = rounded(scaled(rotationVector, 1 / DEGREE));
  const isTurned = turn.some((value) => value !== 0) || scale !== 1;
  return { translation_mm: rounded(translationMm), ...(isTurned ? { rotation_vector_deg: turn, pivot_mm: pivot } : {}), ...(scale === 1 ? {} : { scale }) };
}

function planeRows(draft: PlanDraft, segment: RecipeSegment): HTMLElement[] {
  const index = draft.selectedSegment;
  const set = (planes: RecipeSegment["planes"]) => draft.change(withSegment(draft.recipe, index, { planes: planes?.length === 0 ? undefined : planes }));
  const { planes } = segment;
  if (planes === undefined) {
    const text = "The build cuts where it finds the anatomy. Set planes to choose yourself: put the crosshair on the edge of the upper incisors first, or place landmarks.";
    return [el("p", { class: "quiet", text }), button("Set planes", () => set(withStartingPlanes(draft.recipe, segment, draft.anatomy)))];
  }
  const rows = planes.map((plane, at) => {
    const id = `cut ${index} ${at}`;
    const name = `Plane ${at + 1}`;
    if (!hasPoint(plane)) return el("div", { class: "row" }, [el("span", { text: name }), el("small", { text: `of the file ${plane.file}` })]);
    const isSelected = draft.selectedPlane === id;
    return el("div", { class: "row" }, [
      el("span", { text: name }),
      button("Move", () => draft.select(index, isSelected ? null : id), { attributes: { "aria-pressed": String(isSelected), "aria-label": `Move ${name}` } }),
      button("Flip", () => draft.movePlane(id, { ...plane, normal: scaled(plane.normal, -1) }, true), { attributes: { "aria-label": `Flip ${name}` } }),
      button("Remove", () => set(planes.filter((_, other) => other !== at)), { attributes: { "aria-label": `Remove ${name}` } }),
    ]);
  });
  const added = () => roundedPlane({ point_mm: draft.crosshair, normal: draft.frame.superior });
  return [
    ...rows,
    el("div", { class: "buttons" }, [
      button("Add a plane at the crosshair", () => set([...planes, added()])),
      ...(planes.length === 0 ? [] : [button("From the anatomy", () => set(undefined))]),
    ]),
    planeNumbers(draft),
  ];
}

/** For the keyboard: shifts and tilts the chosen plane in small steps. */
export function planeNumbers(draft: PlanDraft): HTMLElement {
  const chosen = draft.planes.find(({ id }) => id === draft.selectedPlane);
  if (chosen === undefined) return el("div");
  const { id, plane } = chosen;
  const { left, posterior, superior } = draft.frame;
  const shift = (mm: number) => draft.movePlane(id, { ...plane, point_mm: sum(plane.point_mm, scaled(plane.normal, mm / norm(plane.normal))) }, true);
  const tilt = (axis: Vector, degrees: number) => draft.movePlane(id, { ...plane, normal: apply(fromRotationVector(scaled(axis, degrees * DEGREE)), plane.normal) }, true);
  const pair = (label: string, less: () => void, more: () => void) =>
    el("div", { class: "row" }, [el("span", { text: label }), button("−", less, { attributes: { "aria-label": `${label}, less` } }), button("+", more, { attributes: { "aria-label": `${label}, more` } })]);
  return el("div", { class: "rows", attributes: { role: "group", "aria-label": `Move ${chosen.label}` } }, [
    pair("Shift 1 mm", () => shift(-1), () => shift(1)),
    pair("Pitch 2°", () => tilt(left, -2), () => tilt(left, 2)),
    pair("Roll 2°", () => tilt(posterior, -2), () => tilt(posterior, 2)),
    pair("Yaw 2°", () => tilt(superior, -2), () => tilt(superior, 2)),
  ]);
}
