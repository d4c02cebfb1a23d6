// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Pose } from "../geometry/pose";
import { sizesOf } from "./answer_sizes";
import { Motion, rowNorm, writeTurn } from "./motion";
import type { PreparedColumns } from "./prepared_columns";

/** Of gains beyond those that are known. */
const GAIN_ALLOWANCE = 1.5;
const LEBESGUE_DEGREES = 4;

/** Of `gradient_field`: turns at the nodes become polynomials' coefficients, and these and the handles' motions factors. */
export class GradientFactors {
  readonly factors: Float64Array;
  modelErrorMm = 0;

  private readonly handles: number;
  private readonly atNodes: Float64Array;
  private readonly coefficients: Float64Array;
  private readonly sizes: Float64Array;
  /** Rotation vector and scale: of one node, and of every corner of the simplex. */
  private readonly blend = new Float64Array(4);
  private readonly corners: Float64Array;
  private readonly cornerValues: Float64Array;
  private readonly turn = new Float64Array(9);
  private readonly motion = new Motion();
  private readonly largestGuard: number;

  constructor(private readonly answers: PreparedColumns) {
    const { factors, nodes } = sizesOf(answers);
    this.handles = answers.numbers.handles;
    this.factors = new Float64Array(3 * factors);
    this.atNodes = new Float64Array(9 * nodes);
    this.coefficients = new Float64Array(9 * nodes);
    this.sizes = new Float64Array(nodes);
    this.corners = new Float64Array(4 * (this.handles + 1));
    this.cornerValues = new Float64Array(this.handles);
    this.largestGuard = answers.guardGains.reduce((a, b) => Math.max(a, b), 0);
  }

  set(poses: readonly Pose[]): void {
    this.expand(poses);
    this.modelErrorMm = this.truncation() + this.answers.numbers.largestGainMm * this.remainder(poses);
    const { factors, coefficients, motion } = this;
    const { polynomials } = this.answers.numbers;
    for (let n = 0; n < polynomials; ++n) writeTransposed(coefficients, 9 * n, factors, 9 * (polynomials - 1 - n));
    for (let h = 0; h < this.handles; ++h) {
      const at = 3 * (3 * polynomials + 4 * h);
      motion.set(poses[h], this.answers.origins, 3 * h);
      writeTransposed(motion.turn, 0, factors, at);
      factors.set(motion.move, at + 9);
    }
  }

  private expand(poses: readonly Pose[]): void {
    const { atNodes, coefficients, sizes, blend, turn } = this;
    const { nodes, interpolation } = this.answers;
    const count = sizes.length;
    for (let node = 0; node < count; ++node) {
      blendPoses(poses, nodes, node * this.handles, blend, 0);
      writeTurn(blend[0], blend[1], blend[2], blend[3], turn);
      atNodes.set(turn, 9 * node);
    }
    for (let n = 0; n < count; ++n) {
      for (let i = 0; i < 9; ++i) {
        let sum = 0;
        for (let node = 0; node < count; ++node) sum += interpolation[n * count + node] * atNodes[9 * node + i];
        coefficients[9 * n + i] = sum;
      }
      sizes[n] = rowNorm(coefficients, 9 * n, 9);
    }
  }

  private truncation(): number {
    const { guardGains, numbers } = this.answers;
    if (guardGains.length === 0) return 0;
    const beyond = numbers.polynomials + guardGains.length;
    let error = 0;
    for (let g = 0; g < guardGains.length; ++g) error += this.sizes[numbers.polynomials + g] * guardGains[g];
    for (let n = beyond; n < this.sizes.length; ++n) error += GAIN_ALLOWANCE * this.largestGuard * this.sizes[n];
    return error;
  }

  private remainder(poses: readonly Pose[]): number {
    const { corners, cornerValues, handles } = this;
    const { numbers, simplexLow } = this.answers;
    cornerValues.set(simplexLow);
    blendPoses(poses, cornerValues, 0, corners, 0);
    for (let h = 0; h < handles; ++h) {
      cornerValues[h] += numbers.simplexWidth;
      blendPoses(poses, cornerValues, 0, corners, 4 * (h + 1));
      cornerValues[h] = simplexLow[h];
    }
    let [square, smallest, largest] = [0, Infinity, -Infinity];
    for (let a = 0; a < corners.length; a += 4) {
      for (let b = 0; b < a; b += 4) {
        const x = corners[a] - corners[b], y = corners[a + 1] - corners[b + 1], z = corners[a + 2] - corners[b + 2];
        square = Math.max(square, x * x + y * y + z * z);
      }
      smallest = Math.min(smallest, corners[a + 3]);
      largest = Math.max(largest, corners[a + 3]);
    }
    if (square === 0) return 0;
    const radius = Math.sqrt((square * handles) / (2 * handles + 2));
    const { degree } = numbers;
    return ((largest + smallest) / 2) * remainderOf(radius, degree) + ((largest - smallest) / 2) * remainderOf(radius, degree - 1);
  }
}

/** Of turning by vectors in a ball of radius r, after polynomials of degree n. */
function remainderOf(r: number, n: number): number {
  let taylor = 1;
  for (let k = 1; k <= n + 1; ++k) taylor *= r / k;
  return Math.min(1, 2 ** (LEBESGUE_DEGREES - n)) * taylor;
}

/** Rotation vector and scale, blended along `values`, which begin at `from`. */
function blendPoses(poses: readonly Pose[], values: Float64Array, from: number, out: Float64Array, at: number): void {
  let x = 0, y = 0, z = 0, scale = 1;
  for (let h = 0; h < poses.length; ++h) {
    const u = values[from + h];
    const { rotationVector } = poses[h];
    x += u * rotationVector[0];
    y += u * rotationVector[1];
    z += u * rotationVector[2];
    scale += u * (poses[h].scale - 1);
  }
  out[at] = x;
  out[at + 1] = y;
  out[at + 2] = z;
  out[at + 3] = scale;
}

function writeTransposed(from: Float64Array, at: number, to: Float64Array, first: number): void {
  for (let i = 0; i < 3; ++i) {
    for (let j = 0; j < 3; ++j) to[first + 3 * j + i] = from[at + 3 * i + j];
  }
}
