// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

// Rotations of three dimensions. Matrices are rows one after the other: 9 numbers.

export type Vector = [number, number, number];
export type Matrix = readonly number[];

export const IDENTITY: Matrix = [1, 0, 0, 0, 1, 0, 0, 0, 1];

export function add(a: Vector, b: Vector): Vector {
  return [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
}

export function subtract(a: Vector, b: Vector): Vector {
  return [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
}

export function scaled(a: Vector, factor: number): Vector {
  return [a[0] * factor, a[1] * factor, a[2] * factor];
}

export function dot(a: Vector, b: Vector): number {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

export function cross(a: Vector, b: Vector): Vector {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

export function norm(a: Vector): number {
  return Math.hypot(a[0], a[1], a[2]);
}

export function apply(m: Matrix, v: Vector): Vector {
  return [m[0] * v[0] + m[1] * v[1] + m[2] * v[2], m[3] * v[0] + m[4] * v[1] + m[5] * v[2], m[6] * v[0] + m[7] * v[1] + m[8] * v[2]];
}

export function transpose(m: Matrix): Matrix {
  return [m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8]];
}

export function multiply(a: Matrix, b: Matrix): Matrix {
  const product: number[] = [];
  for (let i = 0; i < 3; ++i) {
    for (let j = 0; j < 3; ++j) product.push(a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j]);
  }
  return product;
}

/** exp([vector]): by |vector| radians about its axis. */
export function fromRotationVector(vector: Vector): Matrix {
  const angle = norm(vector);
  if (angle < 1e-12) return IDENTITY;
  const [x, y, z] = scaled(vector, 1 / angle);
  const [s, c] = [Math.sin(angle), Math.cos(angle)];
  const t = 1 - c;
  return [
    t * x * x + c, t * x * y - s * z, t * x * z + s * y,
    t * x * y + s * z, t * y * y + c, t * y * z - s * x,
    t * x * z - s * y, t * y * z + s * x, t * z * z + c,
  ];
}

/** The shortest rotation vector, in radians, from 0 to pi. */
export function toRotationVector(m: Matrix): Vector {
  const [w, x, y, z] = toQuaternion(m);
  const sine = Math.hypot(x, y, z);
  if (sine < 1e-12) return [2 * x, 2 * y, 2 * z];
  return scaled([x, y, z], (2 * Math.atan2(sine, w)) / sine);
}

// The largest of the four parts is found first: none of the others is then made of a small difference (Shepperd 1978).
function toQuaternion(m: Matrix): [number, number, number, number] {
  const trace = m[0] + m[4] + m[8];
  const candidates = [trace, m[0], m[4], m[8]];
  const largest = candidates.indexOf(Math.max(...candidates));
  const square = largest === 0 ? 1 + trace : 1 + 2 * candidates[largest] - trace;
  const root = Math.sqrt(square);
  const k = 0.5 / root;
  const [dx, dy, dz] = [m[7] - m[5], m[2] - m[6], m[3] - m[1]];
  const [xy, xz, yz] = [m[1] + m[3], m[2] + m[6], m[5] + m[7]];
  const parts: [number, number, number, number][] = [
    [root / 2, dx * k, dy * k, dz * k],
    [dx * k, root / 2, xy * k, xz * k],
    [dy * k, xy * k, root / 2, yz * k],
    [dz * k, xz * k, yz * k, root / 2],
  ];
  const quaternion = parts[largest];
  return quaternion[0] < 0 ? [-quaternion[0], -quaternion[1], -quaternion[2], -quaternion[3]] : quaternion;
}
