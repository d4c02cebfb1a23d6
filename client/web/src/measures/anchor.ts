// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type Vector, add, dot, norm, scaled, subtract } from "../geometry/rotation";
import { pointAt } from "../geometry/rigid_fit";

/** A point on a surface that moves with it: `weights` of a triangle's corners, at least 0 and 1 together. */
export interface Anchor {
  /** Which of the case's surfaces. */
  surface: number;
  triangle: number;
  weights: Vector;
}

/** #V by 3 and #T by 3. */
export interface Triangles {
  positions: ArrayLike<number>;
  triangles: ArrayLike<number>;
}

export function corners({ positions, triangles }: Triangles, triangle: number): [Vector, Vector, Vector] {
  return [0, 1, 2].map((k) => pointAt(positions, triangles[3 * triangle + k])) as [Vector, Vector, Vector];
}

/** Where the anchor is on a surface that has these positions now. */
export function anchorPoint(shape: Triangles, { triangle, weights }: Anchor): Vector {
  const [a, b, c] = corners(shape, triangle);
  return add(add(scaled(a, weights[0]), scaled(b, weights[1])), scaled(c, weights[2]));
}

/** A number of each vertex, at the anchor. */
export function anchorNumber(values: ArrayLike<number>, triangles: ArrayLike<number>, { triangle, weights }: Anchor): number {
  return [0, 1, 2].reduce((sum, k) => sum + weights[k] * values[triangles[3 * triangle + k]], 0);
}

/** Weights of the point of a triangle that is nearest to `point` (Ericson, Real-Time Collision Detection, 5.1.5). */
export function nearestWeights(point: Vector, [a, b, c]: readonly [Vector, Vector, Vector]): Vector {
  const ab = subtract(b, a), ac = subtract(c, a), ap = subtract(point, a);
  const d1 = dot(ab, ap), d2 = dot(ac, ap);
  if (d1 <= 0 && d2 <= 0) return [1, 0, 0];
  const bp = subtract(point, b);
  const d3 = dot(ab, bp), d4 = dot(ac, bp);
  if (d3 >= 0 && d4 <= d3) return [0, 1, 0];
  const vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return [1 - d1 / (d1 - d3), d1 / (d1 - d3), 0];
  const cp = subtract(point, c);
  const d5 = dot(ab, cp), d6 = dot(ac, cp);
  if (d6 >= 0 && d5 <= d6) return [0, 0, 1];
  const vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return [1 - d2 / (d2 - d6), 0, d2 / (d2 - d6)];
  const va = d3 * d6 - d5 * d4;
  const along = d4 - d3 + (d5 - d6);
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) return [0, 1 - (d4 - d3) / along, (d4 - d3) / along];
  const sum = va + vb + vc;
  return sum === 0 ? [1, 0, 0] : [va / sum, vb / sum, vc / sum];
}

/** The nearest point of a surface; null where none is within `mostMm`. */
export function nearestAnchor(shape: Triangles, surface: number, point: Vector, mostMm: number): { anchor: Anchor; distanceMm: number } | null {
  let best: { anchor: Anchor; distanceMm: number } | null = null;
  for (let triangle = 0; triangle < shape.triangles.length / 3; ++triangle) {
    if (isBeyond(shape, triangle, point, best?.distanceMm ?? mostMm)) continue;
    const weights = nearestWeights(point, corners(shape, triangle));
    const anchor = { surface, triangle, weights };
    const distanceMm = norm(subtract(anchorPoint(shape, anchor), point));
    if (distanceMm <= (best?.distanceMm ?? mostMm)) best = { anchor, distanceMm };
  }
  return best;
}

/** The box about a triangle lies further off than this. */
function isBeyond({ positions, triangles }: Triangles, triangle: number, point: Vector, mostMm: number): boolean {
  const a = 3 * triangles[3 * triangle], b = 3 * triangles[3 * triangle + 1], c = 3 * triangles[3 * triangle + 2];
  for (let k = 0; k < 3; ++k) {
    const [x, y, z] = [positions[a + k], positions[b + k], positions[c + k]];
    if (Math.min(x, y, z) > point[k] + mostMm || Math.max(x, y, z) < point[k] - mostMm) return true;
  }
  return false;
}

/** What a file or the browser's memory says an anchor is, if it is one of these surfaces; else null. */
export function readAnchor(value: unknown, surfaces: readonly Triangles[]): Anchor | null {
  const { surface, triangle, weights } = (value ?? {}) as Partial<Anchor>;
  if (!Number.isInteger(surface) || !Number.isInteger(triangle) || !Array.isArray(weights) || weights.length !== 3) return null;
  const shape = surfaces[surface as number];
  if (shape === undefined || (triangle as number) < 0 || (triangle as number) >= shape.triangles.length / 3) return null;
  const isInside = weights.every((weight) => Number.isFinite(weight) && weight >= -1e-6 && weight <= 1 + 1e-6);
  const sum = weights[0] + weights[1] + weights[2];
  return isInside && Math.abs(sum - 1) < 1e-3 ? { surface: surface as number, triangle: triangle as number, weights: weights as Vector } : null;
}
