// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { bounds } from "./triangle_grid";

/** "unknown": the size does not fit a head in any unit. */
export type Unit = "mm" | "cm" | "m" | "unknown";

/** A photograph of a face alone, or of a head with shoulders. */
const LEAST_HEAD_MM = 80;
const MOST_HEAD_MM = 700;

/** Formats do not say the unit, so the size of a head does. `factor`: to mm; 1 where the unit is unknown. */
export function findUnit(positions: Float32Array): { unit: Unit; factor: number; note: string } {
  const [low, high] = bounds(positions);
  const size = Math.max(...high.map((value, k) => value - low[k]));
  const known = ([["mm", 1], ["cm", 10], ["m", 1000]] as const).find(([, factor]) => size * factor >= LEAST_HEAD_MM && size * factor <= MOST_HEAD_MM);
  if (known === undefined) return { unit: "unknown", factor: 1, note: `The photograph is ${size.toPrecision(3)} units large, which is no head in m, cm or mm: its scale is not known.` };
  const [unit, factor] = known;
  return { unit, factor, note: `Unit by size: ${unit}; the photograph is ${Math.round(size * factor)} mm large.` };
}
