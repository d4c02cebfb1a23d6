// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

/** The vertices of a region without contact: those of the request and what sticks to it. `sticking`: of the case; -1: the fixed region. Rising. */
export function withSticking(vertices: readonly number[], sticking: Int32Array, region: number): number[] {
  const stuck = Array.from(sticking).filter((_, i) => i % 2 === 0 && sticking[i + 1] === region);
  return [...vertices, ...stuck].sort((a, b) => a - b);
}
