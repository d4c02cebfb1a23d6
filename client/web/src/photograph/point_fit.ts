// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type Matrix, type Vector, add, apply, dot, norm, scaled, subtract } from "../geometry/rotation";

/** x = scale * rotation * v + translation. A `rotation` with determinant -1 mirrors. */
export interface Similarity {
  scale: number;
  rotation: Matrix;
  translation: Vector;
}

export function transformed({ scale, rotation, translation }: Similarity, point: Vector): Vector {
  return add(scaled(apply(rotation, point), scale), translation);
}

/** All points at once; `points`: #V by 3. */
export function transformAll(map: Similarity, points: Float32Array): Float32Array<ArrayBuffer> {
  const out = new Float32Array(points.length);
  for (let i = 0; i < points.length; i += 3) out.set(transformed(map, [points[i], points[i + 1], points[i + 2]]), i);
  return out;
}

/** Least squares from `from` to `to` (Horn 1987); with `isScaled` the scale, too (Umeyama 1991). At least three points, not on a line. */
export function fitPoints(from: readonly Vector[], to: readonly Vector[], isScaled: boolean): Similarity {
  const [a, b] = [mean(from), mean(to)];
  const sums = new Array<number>(9).fill(0);
  let [squares, targets] = [0, 0];
  from.forEach((point, i) => {
    const [p, q] = [subtract(point, a), subtract(to[i], b)];
    for (let k = 0; k < 9; ++k) sums[k] += p[Math.floor(k / 3)] * q[k % 3];
    squares += dot(p, p);
    targets += dot(q, q);
  });
  const rotation = quaternionMatrix(largestEigenvector(hornMatrix(sums)));
  const scale = isScaled ? Math.sqrt(targets / squares) : 1;
  return { scale, rotation, translation: subtract(b, scaled(apply(rotation, a), scale)) };
}

/** How far the point that is furthest off a line through the two that are furthest apart lies from it. */
export function spreadOffLine(points: readonly Vector[]): number {
  let [from, along]: [Vector, Vector] = [[0, 0, 0], [0, 0, 0]];
  for (const a of points) for (const b of points) if (norm(subtract(b, a)) > norm(along)) [from, along] = [a, subtract(b, a)];
  const unit = scaled(along, 1 / (norm(along) || 1));
  return Math.max(...points.map((point) => {
    const offset = subtract(point, from);
    return norm(subtract(offset, scaled(unit, dot(offset, unit))));
  }));
}

function mean(points: readonly Vector[]): Vector {
  return scaled(points.reduce((sum, point) => add(sum, point), [0, 0, 0] as Vector), 1 / points.length);
}

/** 4 by 4, symmetric: its largest eigenvector is the quaternion of the rotation. */
function hornMatrix([xx, xy, xz, yx, yy, yz, zx, zy, zz]: number[]): number[][] {
  return [
    [xx + yy + zz, yz - zy, zx - xz, xy - yx],
    [yz - zy, xx - yy - zz, xy + yx, zx + xz],
    [zx - xz, xy + yx, yy - xx - zz, yz + zy],
    [xy - yx, zx + xz, yz + zy, zz - xx - yy],
  ];
}

/** Jacobi's rotations; `m` is overwritten. */
function largestEigenvector(m: number[][]): number[] {
  const n = m.length;
  const vectors: number[][] = m.map((_, i) => m.map((__, j) => (i === j ? 1 : 0)));
  for (let sweep = 0; sweep < 60; ++sweep) {
    for (let p = 0; p < n; ++p) {
      for (let q = p + 1; q < n; ++q) {
        if (Math.abs(m[p][q]) < 1e-300) continue;
        const angle = 0.5 * Math.atan2(2 * m[p][q], m[q][q] - m[p][p]);
        const [c, s] = [Math.cos(angle), Math.sin(angle)];
        for (let k = 0; k < n; ++k) [m[k][p], m[k][q]] = [c * m[k][p] - s * m[k][q], s * m[k][p] + c * m[k][q]];
        for (let k = 0; k < n; ++k) [m[p][k], m[q][k]] = [c * m[p][k] - s * m[q][k], s * m[p][k] + c * m[q][k]];
        for (let k = 0; k < n; ++k) [vectors[k][p], vectors[k][q]] = [c * vectors[k][p] - s * vectors[k][q], s * vectors[k][p] + c * vectors[k][q]];
      }
    }
  }
  const best = m.reduce((found, row, i) => (row[i] > m[found][found] ? i : found), 0);
  return vectors.map((row) => row[best]);
}

function quaternionMatrix([w, x, y, z]: number[]): Matrix {
  return [
    w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y),
    2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x),
    2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z,
  ];
}
