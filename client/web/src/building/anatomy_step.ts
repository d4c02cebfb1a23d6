// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { button, el, renew, section, select } from "../panels/dom";
import { LANDMARKS, middlePlane, frankfortOf } from "./jaw_planes";
import { type PlanDraft, REFERENCES, type ReferenceId } from "./plan_draft";
import type { Plane } from "./recipe";
import type { Step } from "./step";

/** Landmarks and planes of reference, each found by the build unless it is set here. */
export function anatomyStep(draft: PlanDraft): Step {
  let name = LANDMARKS[0][0];
  const choice = select("Landmark", LANDMARKS.map(([value, label]) => ({ value, label })), (value) => (name = value));
  const place = button("Place at the crosshair", () => draft.setLandmark(name, draft.crosshair));
  const list = el("ul", { class: "placed" });
  const planes = el("div", { class: "rows" });

  const planeRow = (id: ReferenceId, label: string) => {
    const plane = draft.reference(id);
    if (plane === null) return el("div", { class: "row" }, [el("span", { text: label }), el("small", { text: "found by the build" }), button("Set", () => draft.setReference(id, startOf(draft, id)), { attributes: { "aria-label": `Set the ${label}` } })]);
    const edit = button("Move", () => draft.select(draft.selectedSegment, draft.selectedPlane === id ? null : id), { attributes: { "aria-label": `Move the ${label}`, "aria-pressed": String(draft.selectedPlane === id) } });
    return el("div", { class: "row" }, [el("span", { text: label }), edit, button("Found by the build", () => draft.setReference(id, null), { attributes: { "aria-label": `${label}: found by the build` } })]);
  };
  const update = () => {
    renew(
      list,
      draft.landmarks.map((landmark) =>
        el("li", {}, [
          el("span", { text: landmark.label }),
          el("small", { text: landmark.position.map((value) => value.toFixed(1)).join(", ") }),
          button("Remove", () => draft.setLandmark(landmark.name, undefined), { attributes: { "aria-label": `Remove ${landmark.label}` } }),
        ]),
      ),
    );
    renew(planes, REFERENCES.map(({ id, label }) => planeRow(id, label)));
  };
  const element = el("div", {}, [
    section("Landmarks", [
      el("p", { class: "quiet", text: "The build finds landmarks in the CT. Place one only to replace what it finds, at most 20 mm from there. A click on bone sets the crosshair." }),
      choice.element,
      place,
      list,
    ]),
    section("Planes", [planes]),
  ]);
  return { title: "Anatomy", element, needsCt: true, update };
}

/** Where a plane begins that is set by hand. */
export function startOf(draft: PlanDraft, id: ReferenceId): Plane {
  if (id === "occlusal") return middlePlane(draft.anatomy);
  const found = frankfortOf(draft.recipe.landmarks?.points_mm ?? {});
  if (found !== null) return found[id];
  return { point_mm: draft.crosshair, normal: id === "horizontal" ? draft.frame.superior : draft.frame.left };
}
