// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { readFileSync } from "node:fs";
import { type Matrix, type Vector, fromRotationVector } from "../../src/geometry/rotation";
import type { Directions, Volume } from "../../src/volume/volume";

// The volume and the mesh of golden_slices.py.

export interface Golden {
  middle: Vector;
  /** 48 x 40 pixels of 0.6 mm about the middle; -32768 outside. */
  slices: Record<"axial" | "coronal" | "sagittal", number[]>;
  /** Lines of six numbers each. */
  cuts: Record<"flat" | "across" | "oblique", number[][]>;
}

export const golden = JSON.parse(readFileSync(new URL("golden_slices.json", import.meta.url), "utf8")) as Golden;

function columns(m: Matrix): Directions {
  return [[m[0], m[3], m[6]], [m[1], m[4], m[7]], [m[2], m[5], m[8]]];
}

export const goldenAxes = columns(fromRotationVector([0.1, 0.2, -0.15]));

export function goldenVolume(): Volume {
  const size = [23, 19, 17] as const;
  const values = new Int16Array(size[0] * size[1] * size[2]);
  let at = 0;
  for (let k = 0; k < size[2]; ++k) {
    for (let j = 0; j < size[1]; ++j) {
      for (let i = 0; i < size[0]; ++i) values[at++] = ((Math.imul(i, 73856093) ^ Math.imul(j, 19349663) ^ Math.imul(k, 83492791)) & 0x7ff) - 1024;
    }
  }
  return { grid: { size, spacing: [0.7, 1.1, 2.3], origin: [-12.5, 4.25, -30.75], directions: columns(fromRotationVector([0.3, -0.5, 0.8])) }, values, kernel: "" };
}

export function goldenTorus(): { positions: Float32Array; triangles: Uint32Array } {
  const [rings, sides] = [40, 24];
  const positions: number[] = [];
  const triangles: number[] = [];
  const at = (ring: number, side: number) => (ring % rings) * sides + (side % sides);
  for (let ring = 0; ring < rings; ++ring) {
    for (let side = 0; side < sides; ++side) {
      const [u, v] = [(2 * Math.PI * ring) / rings, (2 * Math.PI * side) / sides];
      const tube = 8 + 2 * Math.sin(5 * u);
      positions.push((25 + tube * Math.cos(v)) * Math.cos(u), (25 + tube * Math.cos(v)) * Math.sin(u), tube * Math.sin(v));
      triangles.push(at(ring, side), at(ring + 1, side), at(ring + 1, side + 1), at(ring, side), at(ring + 1, side + 1), at(ring, side + 1));
    }
  }
  return { positions: Float32Array.from(positions), triangles: Uint32Array.from(triangles) };
}
