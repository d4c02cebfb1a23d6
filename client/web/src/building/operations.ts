// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { HeadFrame } from "../geometry/pose";
import { type Vector, scaled } from "../geometry/rotation";
import { headFrameOf, startingPlanes, teethPlane } from "./jaw_planes";
import { type Osteotomy, type Plane, type Recipe, type RecipeSegment, rounded, roundedPlane, withSegments } from "./recipe";

// Operations as they are begun: segments with their usual movement. A segment without planes is cut where the build finds the
// anatomy; one that is cut in pieces has planes, which begin where landmarks are.

export type Template = "bssro" | "le_fort_1" | "le_fort_1_in_2" | "le_fort_1_in_3" | "genioplasty" | "free_lower" | "free_upper";

export const TEMPLATES: readonly { template: Template; label: string }[] = [
  { template: "bssro", label: "Sagittal split of the lower jaw (BSSRO)" },
  { template: "le_fort_1", label: "Le Fort I, in one piece" },
  { template: "le_fort_1_in_2", label: "Le Fort I, in two pieces" },
  { template: "le_fort_1_in_3", label: "Le Fort I, in three pieces" },
  { template: "genioplasty", label: "Genioplasty" },
  { template: "free_lower", label: "Free segment of the lower jaw" },
  { template: "free_upper", label: "Free segment of the upper jaw or skull" },
];

/** Of docs/accuracy.md, "Soft-to-hard ratios". */
const CHIN_DISSECTED_MM = 12;
/** The cut between canine and premolar lies so far behind the incisors. */
const BEHIND_CANINE_MM = 14;

/** With the template's segments behind those that the recipe has: a later one is cut out of earlier ones. */
export function withTemplate(recipe: Recipe, template: Template, at: (name: string) => Vector): Recipe {
  const frame = headFrameOf(recipe);
  const names = recipe.segments.map((segment) => segment.name);
  const added: RecipeSegment[] = [];
  for (const segment of segmentsOf(template, at, frame)) added.push({ ...segment, name: freeName(segment.name, [...names, ...added.map((one) => one.name)]) });
  return withSegments(recipe, [...recipe.segments, ...added]);
}

/** The planes of the segment's kind, to be dragged from there. */
export function withStartingPlanes(recipe: Recipe, segment: RecipeSegment, at: (name: string) => Vector): Plane[] {
  return startingPlanes(segment.osteotomy ?? "bssro", at, headFrameOf(recipe).left).map(roundedPlane);
}

/** What a segment turns about unless the recipe says so: the edge of its incisors, or the chin. */
export function pivotOf(segment: RecipeSegment, at: (name: string) => Vector): Vector {
  const landmark = { bssro: "lower_incisor", le_fort_1: "upper_incisor", genioplasty: "pogonion" }[segment.osteotomy ?? "bssro"];
  return segment.pose?.pivot_mm ?? rounded(at(landmark));
}

function segmentsOf(template: Template, at: (name: string) => Vector, frame: HeadFrame): RecipeSegment[] {
  const forward = (mm: number) => ({ translation_mm: rounded(scaled(frame.posterior, -mm)) });
  const cuts = (kind: Osteotomy) => startingPlanes(kind, at, frame.left);
  switch (template) {
    case "bssro":
      return [{ name: "mandible", osteotomy: "bssro", pose: forward(5) }];
    case "le_fort_1":
      return [{ name: "maxilla", osteotomy: "le_fort_1", pose: forward(4) }];
    case "genioplasty":
      return [{ name: "chin", osteotomy: "genioplasty", dissected_mm: CHIN_DISSECTED_MM, pose: forward(4) }];
    case "le_fort_1_in_2":
      return [
        { name: "maxilla_right", osteotomy: "le_fort_1", planes: cuts("le_fort_1").map(roundedPlane), pose: forward(4) },
        { name: "maxilla_left", osteotomy: "le_fort_1", planes: [...cuts("le_fort_1"), middleCut(at, frame.left)].map(roundedPlane), pose: forward(4) },
      ];
    case "le_fort_1_in_3":
      return [
        { name: "maxilla_front", osteotomy: "le_fort_1", planes: cuts("le_fort_1").map(roundedPlane), pose: forward(4) },
        ...(["left", "right"] as const).map((side): RecipeSegment => {
          const planes = [...cuts("le_fort_1"), middleCut(at, scaled(frame.left, side === "left" ? 1 : -1)), canineCut(at, frame)];
          return { name: `maxilla_${side}`, osteotomy: "le_fort_1", planes: planes.map(roundedPlane), pose: forward(4) };
        }),
      ];
    case "free_lower":
      return [{ name: "segment", osteotomy: "bssro", planes: [roundedPlane({ point_mm: at("lower_incisor"), normal: scaled(frame.superior, -1) })], pose: forward(2) }];
    case "free_upper":
      return [{ name: "segment", osteotomy: "le_fort_1", planes: [roundedPlane({ point_mm: at("nasal_floor"), normal: scaled(frame.superior, -1) })], pose: forward(2) }];
  }
}

function middleCut(at: (name: string) => Vector, normal: Vector): Plane {
  return { point_mm: at("upper_incisor"), normal };
}

function canineCut(at: (name: string) => Vector, frame: HeadFrame): Plane {
  const { normal: up } = teethPlane(at, "upper");
  const [x, y, z] = at("upper_incisor");
  const [p, q, r] = scaled(frame.posterior, BEHIND_CANINE_MM);
  // Upright on the teeth's plane; its positive side is behind.
  const along = frame.posterior[0] * up[0] + frame.posterior[1] * up[1] + frame.posterior[2] * up[2];
  const normal: Vector = [frame.posterior[0] - along * up[0], frame.posterior[1] - along * up[1], frame.posterior[2] - along * up[2]];
  return { point_mm: [x + p, y + q, z + r], normal };
}

function freeName(name: string, taken: readonly string[]): string {
  if (!taken.includes(name)) return name;
  for (let count = 2; ; ++count) if (!taken.includes(`${name}_${count}`)) return `${name}_${count}`;
}
