// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Pose } from "../geometry/pose";
import { sizesOf } from "./answer_sizes";
import { Motion } from "./motion";
import { AnswerModel, type PreparedColumns } from "./prepared_columns";

/** Of `linear_elastic` 12 numbers a handle; of `neo_hookean` also the pairs', and where there is a third order the triples' products. */
export class ElasticFactors {
  readonly factors: Float64Array;
  modelErrorMm = 0;

  private readonly motion = new Motion();
  private readonly numbers: Float64Array;
  private readonly pairs: Float64Array;
  private readonly triples: Float64Array;

  constructor(private readonly answers: PreparedColumns) {
    const { factors, pairs, triples } = sizesOf(answers);
    this.factors = new Float64Array(factors);
    this.numbers = new Float64Array(6 * answers.numbers.handles);
    this.pairs = this.factors.subarray(12 * answers.numbers.handles, 12 * answers.numbers.handles + pairs);
    this.triples = new Float64Array(triples);
  }

  set(poses: readonly Pose[]): void {
    writeElasticFactors(poses, this.answers.origins, this.motion, this.factors);
    if (this.answers.numbers.model === AnswerModel.NEO_HOOKEAN) this.setSeries(poses);
  }

  private setSeries(poses: readonly Pose[]): void {
    const { answers, numbers, pairs, triples, factors } = this;
    this.setNumbers(poses);
    writePairs(numbers, pairs);
    let seriesMm = this.estimate();
    if (triples.length > 0) {
      writeTriples(numbers, triples);
      const second = lengthOf(answers.secondLengths, pairs);
      const ratio = second > 0 ? lengthOf(answers.thirdLengths, triples) / second : 0;
      const first = factors.length - triples.length;
      for (let p = 0; p < triples.length; ++p) factors[first + p] = triples[p] / (1 + ratio);
      seriesMm = (Math.max(seriesMm, weightedNorm(answers.thirdGains, triples)) * ratio) / (1 + ratio);
    }
    const { roundingMm, cutPerMm } = answers.numbers;
    this.modelErrorMm = seriesMm + roundingMm + cutPerMm * weightedNorm(answers.firstGains, numbers);
  }

  /** Of every handle the sine of its turn times the axis, and how its middle moves. */
  private setNumbers(poses: readonly Pose[]): void {
    const { numbers, motion } = this;
    for (let h = 0; h < poses.length; ++h) {
      motion.set(poses[h], this.answers.centroids, 3 * h);
      const { turn, move } = motion;
      const half = 0.5 / poses[h].scale;
      numbers[6 * h] = half * (turn[7] - turn[5]);
      numbers[6 * h + 1] = half * (turn[2] - turn[6]);
      numbers[6 * h + 2] = half * (turn[3] - turn[1]);
      numbers.set(move, 6 * h + 3);
    }
  }

  /** Of second order. */
  private estimate(): number {
    const { pairs } = this;
    const { probes, secondGains, numbers } = this.answers;
    let farthest = 0;
    for (let first = 0; first < probes.length; first += 3 * pairs.length) {
      let square = 0;
      for (let row = 0; row < 3; ++row) {
        const sum = rowProduct(probes, first + row * pairs.length, pairs);
        square += sum * sum;
      }
      farthest = Math.max(farthest, square);
    }
    return (numbers.estimateScale * (Math.sqrt(farthest) * weightedNorm(secondGains, pairs)) ** 0.75) / Math.sqrt(numbers.sizeMm);
  }
}

/** A and b of every handle about the origin, 12 numbers each. */
export function writeElasticFactors(poses: readonly Pose[], origin: Float64Array, motion: Motion, out: Float64Array): void {
  for (let h = 0; h < poses.length; ++h) {
    motion.set(poses[h], origin, 0);
    for (let i = 0; i < 3; ++i) {
      const at = 12 * h + 4 * i;
      for (let j = 0; j < 3; ++j) out[at + j] = motion.turn[3 * i + j];
      out[at + 3] = motion.move[i];
    }
  }
}

/** For all a <= b, those of two different ones twice. */
function writePairs(numbers: Float64Array, out: Float64Array): void {
  let at = 0;
  for (let a = 0; a < numbers.length; ++a) {
    for (let b = a; b < numbers.length; ++b) out[at++] = (a === b ? 1 : 2) * numbers[a] * numbers[b];
  }
}

/** For all a <= b <= c, as often as there are orders of the three. */
function writeTriples(numbers: Float64Array, out: Float64Array): void {
  let at = 0;
  for (let a = 0; a < numbers.length; ++a) {
    for (let b = a; b < numbers.length; ++b) {
      for (let c = b; c < numbers.length; ++c) {
        const orders = a === c ? 1 : a === b || b === c ? 3 : 6;
        out[at++] = orders * numbers[a] * numbers[b] * numbers[c];
      }
    }
  }
}

function rowProduct(rows: Float32Array, first: number, products: Float64Array): number {
  let sum = 0;
  for (let p = 0; p < products.length; ++p) sum += rows[first + p] * products[p];
  return sum;
}

/** The length of what a matrix of that many columns gives of the products. */
function lengthOf(rows: Float32Array, products: Float64Array): number {
  let square = 0;
  for (let first = 0; first < rows.length; first += products.length) {
    const sum = rowProduct(rows, first, products);
    square += sum * sum;
  }
  return Math.sqrt(square);
}

function weightedNorm(gains: Float64Array, products: Float64Array): number {
  let square = 0;
  for (let p = 0; p < products.length; ++p) {
    const value = gains[p] * products[p];
    square += value * value;
  }
  return Math.sqrt(square);
}
