// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Pose } from "../geometry/pose";

// Of a pose the matrix A = s R - I, row-major, and b, by which a point p is displaced: A (v - p) + b. Written in place.

/** A of a rotation vector and a scale; exactly 0 for the identity. */
export function writeTurn(x: number, y: number, z: number, scale: number, out: Float64Array): void {
  const angle = Math.sqrt(x * x + y * y + z * z);
  out.fill(0);
  out[0] = out[4] = out[8] = scale - 1;
  if (angle === 0) return;
  const a = x / angle, b = y / angle, c = z / angle;
  const sine = scale * Math.sin(angle);
  // Of 1 - cos, without the digits that the difference would lose.
  const half = Math.sin(angle / 2);
  const versine = scale * 2 * half * half;
  out[0] += versine * (a * a - 1);
  out[1] += versine * a * b - sine * c;
  out[2] += versine * a * c + sine * b;
  out[3] += versine * a * b + sine * c;
  out[4] += versine * (b * b - 1);
  out[5] += versine * b * c - sine * a;
  out[6] += versine * a * c - sine * b;
  out[7] += versine * b * c + sine * a;
  out[8] += versine * (c * c - 1);
}

/** A and b of a pose about a point. */
export class Motion {
  readonly turn = new Float64Array(9);
  readonly move = new Float64Array(3);

  /** `point`: three numbers from `at` on. */
  set(pose: Pose, point: Float64Array, at: number): void {
    const { rotationVector, pivotMm, translationMm } = pose;
    const { turn, move } = this;
    writeTurn(rotationVector[0], rotationVector[1], rotationVector[2], pose.scale, turn);
    const x = point[at] - pivotMm[0], y = point[at + 1] - pivotMm[1], z = point[at + 2] - pivotMm[2];
    for (let i = 0; i < 3; ++i) move[i] = translationMm[i] + turn[3 * i] * x + turn[3 * i + 1] * y + turn[3 * i + 2] * z;
  }
}

/** The length of a row of `width` numbers from `at` on. */
export function rowNorm(rows: Float64Array, at: number, width: number): number {
  let square = 0;
  for (let f = 0; f < width; ++f) square += rows[at + f] * rows[at + f];
  return Math.sqrt(square);
}
