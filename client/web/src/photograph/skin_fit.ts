// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { vertexNormals } from "../geometry/following_surface";
import { type Vector, add, apply, cross, dot, fromRotationVector, multiply, norm, scaled, subtract } from "../geometry/rotation";
import type { Triangles } from "../measures/anchor";
import { type Similarity, fitPoints, transformed } from "./point_fit";
import { TriangleGrid } from "./triangle_grid";

/** Points of the photograph that are laid upon the skin; normals are unit vectors. */
export interface Samples {
  points: Vector[];
  normals: Vector[];
}

/** A ball in which the skin is not compared: eyes are open in one and closed in the other. */
export interface Ball {
  middle: Vector;
  radiusMm: number;
}

/** How well the photograph fits, over the points of the face outside the balls. */
export interface Fit {
  map: Similarity;
  medianMm: number;
  percentile95Mm: number;
}

const MAX_SAMPLES = 4000;
const FINE_STEPS = 15;
/** The first steps use every fifth point: they only have to come near. */
const COARSE_STEPS = 25;
const COARSE_STRIDE = 5;
/** Of the points within reach, the nearest are used: hair, clothes and what moved since are among the others. */
const KEPT_SHARE = 0.8;
const FIRST_REACH_MM = 20;
const LEAST_REACH_MM = 6;
/** The face is so large about the landmarks' middle; hair, ears and clothes are mostly beyond. */
const FACE_RADIUS_MM = 60;
/** A point of the face that is further off counts as so far. */
const LARGEST_MM = 25;
const LEAST_STEP = 1e-5;

/** Spread evenly over the vertices. */
export function samplesOf(surface: { positions: Float32Array; triangles: Uint32Array }): Samples {
  const normals = vertexNormals(surface.positions, surface.triangles);
  const count = surface.positions.length / 3;
  const step = Math.max(1, count / MAX_SAMPLES);
  const samples: Samples = { points: [], normals: [] };
  for (let i = 0; i < count; i += step) {
    const at = 3 * Math.floor(i);
    if (normals[at] === 0 && normals[at + 1] === 0 && normals[at + 2] === 0) continue;
    samples.points.push([surface.positions[at], surface.positions[at + 1], surface.positions[at + 2]]);
    samples.normals.push([normals[at], normals[at + 1], normals[at + 2]]);
  }
  return samples;
}

function everyFifth({ points, normals }: Samples): Samples {
  const isKept = (_: Vector, i: number) => i % COARSE_STRIDE === 0;
  return { points: points.filter(isKept), normals: normals.filter(isKept) };
}

/** Lays samples on a skin, from landmarks: point to plane (Chen and Medioni 1992), trimmed. */
export class SkinFit {
  private readonly grid: TriangleGrid;

  constructor(
    private readonly skin: Triangles,
    private readonly masked: readonly Ball[],
  ) {
    this.grid = new TriangleGrid(skin);
  }

  fit(samples: Samples, from: readonly Vector[], to: readonly Vector[], isScaled: boolean): Fit {
    let map = fitPoints(from, to, isScaled);
    const coarse = everyFifth(samples);
    for (let step = 0; step < COARSE_STEPS + FINE_STEPS; ++step) {
      const next = this.improve(map, step < COARSE_STEPS ? coarse : samples, Math.max(LEAST_REACH_MM, FIRST_REACH_MM * 0.8 ** step), isScaled);
      if (next === null) break;
      map = next.map;
      if (step > COARSE_STEPS && next.change < LEAST_STEP) break;
    }
    const middle = scaled(to.reduce((sum, point) => add(sum, point), [0, 0, 0] as Vector), 1 / to.length);
    return { map, ...this.measure(map, samples, middle) };
  }

  private isMasked(point: Vector): boolean {
    return this.masked.some(({ middle, radiusMm }) => norm(subtract(point, middle)) < radiusMm);
  }

  /** Null where too few points are within reach. */
  private improve(map: Similarity, { points, normals }: Samples, reachMm: number, isScaled: boolean): { map: Similarity; change: number } | null {
    const pairs: { point: Vector; normal: Vector; offset: number; distance: number }[] = [];
    for (let i = 0; i < points.length; ++i) {
      const point = transformed(map, points[i]);
      if (this.isMasked(point)) continue;
      const { triangle, distanceMm, weights } = this.grid.nearest(point[0], point[1], point[2], reachMm, apply(map.rotation, normals[i]));
      if (triangle < 0) continue;
      const normal = [0, 1, 2].map((k) => this.grid.normals[3 * triangle + k]) as Vector;
      pairs.push({ point, normal, offset: dot(normal, subtract(point, this.pointOn(triangle, weights))), distance: distanceMm });
    }
    if (pairs.length < 100) return null;
    pairs.sort((a, b) => a.distance - b.distance);
    return moved(map, pairs.slice(0, Math.floor(KEPT_SHARE * pairs.length)), isScaled);
  }

  private measure(map: Similarity, { points, normals }: Samples, middle: Vector): Omit<Fit, "map"> {
    const distances: number[] = [];
    points.forEach((sample, i) => {
      const point = transformed(map, sample);
      if (norm(subtract(point, middle)) > FACE_RADIUS_MM || this.isMasked(point)) return;
      distances.push(this.grid.nearest(point[0], point[1], point[2], LARGEST_MM, apply(map.rotation, normals[i])).distanceMm);
    });
    distances.sort((a, b) => a - b);
    const at = (share: number) => distances[Math.floor(share * (distances.length - 1))] ?? LARGEST_MM;
    return { medianMm: at(0.5), percentile95Mm: at(0.95) };
  }

  private pointOn(triangle: number, weights: readonly number[]): Vector {
    const { positions, triangles } = this.skin;
    return [0, 1, 2].map((k) => weights.reduce((sum, weight, corner) => sum + weight * positions[3 * triangles[3 * triangle + corner] + k], 0)) as Vector;
  }
}

/** One step of Gauss-Newton about the pairs' middle, which keeps the equations well conditioned. */
function moved(map: Similarity, pairs: readonly { point: Vector; normal: Vector; offset: number }[], isScaled: boolean): { map: Similarity; change: number } {
  const middle = scaled(pairs.reduce((sum, { point }) => add(sum, point), [0, 0, 0] as Vector), 1 / pairs.length);
  const size = isScaled ? 7 : 6;
  const matrix = Array.from({ length: size }, () => new Array<number>(size + 1).fill(0));
  for (const { point, normal, offset } of pairs) {
    const arm = subtract(point, middle);
    const row = [...cross(arm, normal), ...normal, dot(arm, normal)];
    for (let i = 0; i < size; ++i) {
      for (let j = 0; j < size; ++j) matrix[i][j] += row[i] * row[j];
      matrix[i][size] -= row[i] * offset;
    }
  }
  const x = solve(matrix);
  const rotation = fromRotationVector([x[0], x[1], x[2]]);
  const factor = isScaled ? 1 + x[6] : 1;
  const shift = add(middle, [x[3], x[4], x[5]]);
  const translation = add(shift, scaled(apply(rotation, subtract(map.translation, middle)), factor));
  return { map: { scale: map.scale * factor, rotation: multiply(rotation, map.rotation), translation }, change: Math.hypot(...x) };
}

/** Gauss with pivots; the last column is the right side. What the equations leave open stays 0. */
function solve(m: number[][]): number[] {
  const n = m.length;
  for (let k = 0; k < n; ++k) {
    const pivot = m.reduce((best, row, i) => (i >= k && Math.abs(row[k]) > Math.abs(m[best][k]) ? i : best), k);
    [m[k], m[pivot]] = [m[pivot], m[k]];
    for (let i = k + 1; i < n; ++i) {
      const factor = m[k][k] === 0 ? 0 : m[i][k] / m[k][k];
      for (let j = k; j <= n; ++j) m[i][j] -= factor * m[k][j];
    }
  }
  const x = new Array<number>(n).fill(0);
  for (let k = n - 1; k >= 0; --k) {
    const rest = m[k].slice(k + 1, n).reduce((sum, entry, j) => sum + entry * x[k + 1 + j], 0);
    x[k] = Math.abs(m[k][k]) < 1e-9 ? 0 : (m[k][n] - rest) / m[k][k];
  }
  return x;
}
