// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type Matrix, type Vector, apply, cross, multiply, norm, scaled, subtract, toRotationVector, transpose } from "./rotation";
import type { Pose } from "./pose";

// Followers of a drag receive positions and not poses. Three vertices of a segment show where all of it is.

const SMALLEST_SPREAD_MM = 1;

/** Three of `vertices` that are far from each other and from a line, or null without such vertices; `positions`: #V by 3. */
export function spreadTriple(positions: Float32Array, vertices: readonly number[]): [number, number, number] | null {
  if (vertices.length < 3) return null;
  const first = vertices[0];
  const second = best(vertices, (v) => norm(subtract(pointAt(positions, v), pointAt(positions, first))));
  const along = subtract(pointAt(positions, second), pointAt(positions, first));
  const height = (v: number) => norm(cross(subtract(pointAt(positions, v), pointAt(positions, first)), along)) / norm(along);
  if (norm(along) < SMALLEST_SPREAD_MM) return null;
  const third = best(vertices, height);
  return height(third) < SMALLEST_SPREAD_MM ? null : [first, second, third];
}

/** The rigid pose about the origin that takes the three points `rest` to `now`. */
export function rigidPose(rest: readonly [Vector, Vector, Vector], now: readonly [Vector, Vector, Vector]): Pose {
  const rotation = multiply(transpose(triad(now)), triad(rest));
  return {
    rotationVector: toRotationVector(rotation),
    pivotMm: [0, 0, 0],
    translationMm: subtract(now[0], apply(rotation, rest[0])),
    scale: 1,
  };
}

export function pointAt(positions: ArrayLike<number>, vertex: number): Vector {
  return [positions[3 * vertex], positions[3 * vertex + 1], positions[3 * vertex + 2]];
}

/** Unit vectors at right angles that move with the points, as rows. */
function triad([a, b, c]: readonly [Vector, Vector, Vector]): Matrix {
  const along = unit(subtract(b, a));
  const out = unit(cross(along, subtract(c, a)));
  return [...along, ...out, ...cross(along, out)];
}

function unit(v: Vector): Vector {
  return scaled(v, 1 / norm(v));
}

function best(vertices: readonly number[], score: (vertex: number) => number): number {
  let chosen = vertices[0];
  let highest = -Infinity;
  for (const vertex of vertices) {
    const value = score(vertex);
    if (value > highest) [chosen, highest] = [vertex, value];
  }
  return chosen;
}
