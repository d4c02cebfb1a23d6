// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { ContactRow } from "../generated/tissueform/v1/session_pb";

/** The vertices of a region without contact: those of the request and what sticks to it. `sticking`: of the case; -1: the fixed region. Rising. */
export function withSticking(vertices: readonly number[], sticking: Int32Array, region: number): number[] {
  const stuck = Array.from(sticking).filter((_, i) => i % 2 === 0 && sticking[i + 1] === region);
  return [...vertices, ...stuck].sort((a, b) => a - b);
}

/** For every vertex the first one at its place that rows join it with: itself unless it is a double. `positions`: #V by 3. */
export function firstAtPlace(positions: ArrayLike<number>, rows: readonly ContactRow[]): Int32Array {
  const first = Int32Array.from({ length: positions.length / 3 }, (_, vertex) => vertex);
  for (const { vertex, other } of rows) {
    if (other.case !== "otherVertex") continue;
    const [earlier, later] = [Math.min(vertex, other.value), Math.max(vertex, other.value)];
    if (![0, 1, 2].every((axis) => positions[3 * earlier + axis] === positions[3 * later + axis])) continue;
    first[later] = Math.min(first[later], earlier);
  }
  // An earlier vertex is settled before those that are joined with it.
  first.forEach((vertex, i) => (first[i] = first[vertex]));
  return first;
}

/** How many vertices are left where the doubles, which come last, are gone. */
export function keptCount(first: Int32Array): number {
  let kept = first.length;
  while (kept > 0 && first[kept - 1] !== kept - 1) --kept;
  return kept;
}
