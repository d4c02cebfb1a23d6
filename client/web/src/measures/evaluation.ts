// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { MeasureDefinition } from "./definitions";
import type { FacePoint, FacePoints } from "./face_point";

/** Of `after`: where it stays in 95 of 100 cases. */
export interface Band {
  lowest: number;
  highest: number;
  /** Surgery and model are in doubt, too; otherwise the material alone. */
  parts?: BandParts;
}

/** Half the interval that each alone would cause. */
export interface BandParts {
  /** Where the deviations of surgery and model are from: "published". */
  source: string;
  surgery: number;
  model: number;
  /** Null where it is not known. */
  material: number | null;
}

/** A measure of one face, before and after. */
export type MeasureResult = { definition: MeasureDefinition } & (
  | { kind: "value"; before: number; after: number; band: Band | null }
  | { kind: "missing"; landmarks: string[] }
  | { kind: "impossible"; text: string }
);

/** Where landmarks are, and within which distance those of the skin stay; null where that is not known. */
export interface MeasuredFace {
  before: FacePoints;
  after: FacePoints;
  bandsMm: ReadonlyMap<string, number> | null;
  /** Where the midsagittal plane lies. */
  isMiddleKnown: boolean;
}

export function evaluate(definition: MeasureDefinition, face: MeasuredFace): MeasureResult {
  const missing = definition.landmarks.filter((name) => !face.before.has(name) || !face.after.has(name));
  if (missing.length > 0) return { definition, kind: "missing", landmarks: missing };
  const points = (of: FacePoints) => definition.landmarks.map((name) => of.get(name) as FacePoint);
  const [before, after] = [points(face.before), points(face.after)];
  if (definition.isFromMiddle === true && !face.isMiddleKnown) return { definition, kind: "impossible", text: "the midsagittal plane of this case is unknown" };
  const text = definition.problem(before) ?? definition.problem(after);
  if (text !== null) return { definition, kind: "impossible", text };
  return { definition, kind: "value", before: definition.of(before), after: definition.of(after), band: bandOf(definition, after, face.bandsMm) };
}

const STEP_MM = 0.01;
const AXES = ["left", "forward", "up"] as const;

/**
 * As if every landmark were off by all of its band in the direction that changes the measure most: at least as wide as the
 * measure's own band, for errors of landmarks may cancel and are taken not to. Slopes are central differences. Null where none
 * of the landmarks is of the skin: bone goes where it is put.
 */
function bandOf(definition: MeasureDefinition, points: readonly FacePoint[], bandsMm: MeasuredFace["bandsMm"]): Band | null {
  if (bandsMm === null || !definition.landmarks.some((name) => bandsMm.has(name))) return null;
  const value = definition.of(points);
  let half = 0;
  definition.landmarks.forEach((name, index) => {
    const slope = Math.hypot(...AXES.map((axis) => slopeAlong(definition, points, index, axis)));
    half += slope * (bandsMm.get(name) ?? 0);
  });
  return { lowest: value - half, highest: value + half };
}

function slopeAlong(definition: MeasureDefinition, points: readonly FacePoint[], index: number, axis: (typeof AXES)[number]): number {
  const at = (step: number) => definition.of(points.map((point, k) => (k === index ? { ...point, [axis]: point[axis] + step } : point)));
  return (at(STEP_MM) - at(-STEP_MM)) / (2 * STEP_MM);
}
