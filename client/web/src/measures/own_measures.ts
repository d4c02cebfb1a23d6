// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { MeasureDefinition } from "./definitions";
import { angleDeg, distanceMm } from "./face_point";

/** A distance between two landmarks or, with three, the angle at the second; both in space. */
export interface OwnMeasure {
  landmarks: readonly string[];
}

export const MOST_OWN_MEASURES = 24;
const LEAST_ARM_MM = 1;

/** As a measure with a name by its number. `label` of a landmark's name. */
export function ownDefinition({ landmarks }: OwnMeasure, index: number, label: (name: string) => string): MeasureDefinition {
  const isDistance = landmarks.length === 2;
  return {
    name: `own_${index + 1}`,
    title: landmarks.map(label).join(" – "),
    unit: isDistance ? "mm" : "deg",
    landmarks,
    norm: null,
    problem: ([a, at, b]) => {
      if (isDistance) return null;
      return distanceMm(a, at) < LEAST_ARM_MM || distanceMm(at, b) < LEAST_ARM_MM ? "two of its landmarks coincide: check them" : null;
    },
    of: ([a, at, b]) => (isDistance ? distanceMm(a, at) : angleDeg(a, at, b)),
  };
}

/** The saved measures; invalid entries are left out. */
export function readOwnMeasures(value: unknown): OwnMeasure[] {
  if (!Array.isArray(value)) return [];
  const isName = (name: unknown) => typeof name === "string" && /^[a-z_0-9]{1,40}$/.test(name);
  return value
    .filter((entry) => Array.isArray(entry?.landmarks) && [2, 3].includes(entry.landmarks.length) && entry.landmarks.every(isName))
    .slice(0, MOST_OWN_MEASURES)
    .map(({ landmarks }) => ({ landmarks: [...landmarks] as string[] }));
}
