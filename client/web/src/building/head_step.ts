// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { anglesOf, headAxes, rotationOf } from "../geometry/pose";
import { type Vector, apply, transpose } from "../geometry/rotation";
import { button, el, section } from "../panels/dom";
import { SCANNER_FRAME, frankfortOf } from "./jaw_planes";
import type { PlanDraft } from "./plan_draft";
import { type Recipe, roundedPlane, withValue } from "./recipe";
import { type Step, numberField } from "./step";

const ANGLES = [
  ["pitchDeg", "Pitch (chin up)"],
  ["rollDeg", "Roll (to the left)"],
  ["yawDeg", "Yaw (to the left)"],
] as const;

type Angles = ReturnType<typeof anglesOf>;

/** Natural head position: the recipe's head frame. It turns views and the axes of all numbers; places stay. */
export function headStep(draft: PlanDraft): Step {
  const current = () => anglesOf(transpose(headAxes(draft.frame)));
  const set = (angles: Angles, isFinal = true) => draft.change(withHeadAngles(draft.recipe, angles, draft.crosshair), isFinal);
  const fields = ANGLES.map(([key, label]) => {
    const field = numberField(label, "°", (value) => set({ ...current(), [key]: value }));
    return { key, field };
  });
  const source = el("p", { class: "quiet" });
  const byLandmarks = button("From porion and orbitale", () => {
    const planes = frankfortOf(draft.recipe.landmarks?.points_mm ?? {});
    if (planes !== null) draft.change(withValue(draft.recipe, ["head_frame"], { midsagittal: roundedPlane(planes.midsagittal), horizontal: roundedPlane(planes.horizontal) }));
  });
  const byBuild = button("As the build finds it", () => draft.change(withValue(draft.recipe, ["head_frame"], undefined)));
  const element = section("Head position", [
    el("p", { class: "quiet", text: "Turns the views and the directions of forward, up and left, in which movements are given. The CT and all places stay as they are." }),
    ...fields.map(({ field }) => field.element),
    source,
    el("div", { class: "buttons" }, [byLandmarks, byBuild]),
  ]);
  const update = () => {
    const angles = current();
    fields.forEach(({ key, field }) => field.set(angles[key]));
    byLandmarks.disabled = frankfortOf(draft.recipe.landmarks?.points_mm ?? {}) === null;
    source.textContent = draft.recipe.head_frame === undefined ? "Not set: the page shows the scanner's axes, and the build takes the Frankfort horizontal where it finds it." : "Set in the recipe.";
  };
  return { title: "Head position", element, needsCt: true, update };
}

/** The recipe with a head that is turned by these angles from the scanner's axes; `through`: a point of both planes. */
export function withHeadAngles(recipe: Recipe, { pitchDeg, rollDeg, yawDeg }: Angles, through: Vector): Recipe {
  const turn = rotationOf(pitchDeg, rollDeg, yawDeg);
  const of = (axis: Vector) => apply(turn, axis);
  const horizontal = roundedPlane({ point_mm: through, normal: of(SCANNER_FRAME.superior) });
  const midsagittal = roundedPlane({ point_mm: through, normal: of(SCANNER_FRAME.left) });
  return withValue(recipe, ["head_frame"], { midsagittal, horizontal });
}

