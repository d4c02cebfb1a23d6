// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Pose } from "../geometry/pose";
import { sizesOf } from "./answer_sizes";
import type { ColumnKernel } from "./column_kernel";
import { ColumnMatrix, bandPartOf } from "./column_matrix";
import { writeElasticFactors } from "./elastic_factors";
import { Motion } from "./motion";
import type { PreparedColumns } from "./prepared_columns";

/** Square roots of the 95th percentiles of chi-squared with 1, 2 and 3 degrees of freedom. */
const OF_ONE = 1.959964;
const OF_TWO = 2.447747;
const OF_THREE = 2.795483;

/**
 * The band of uncertainty: of each vertex the distance in mm within which it stays in 95 of 100 cases if nothing but the material
 * is in doubt. What the server tells, in first order; nothing is allocated by a pose.
 */
export class AnswerBand {
  /** Of every vertex of the answer; 0 where it is not free. */
  readonly bandMm: Float32Array;

  private readonly matrix: ColumnMatrix;
  private readonly factors: Float64Array;
  private readonly mapped: Float64Array;
  private readonly motion = new Motion();
  private readonly variables: number;

  /** `free`: places of the free vertices. REQUIRES: there are columns of the band. */
  constructor(
    private readonly answers: PreparedColumns,
    private readonly free: Uint32Array,
    kernel: ColumnKernel,
  ) {
    const sizes = sizesOf(answers);
    this.variables = sizes.bandVariables;
    this.matrix = new ColumnMatrix(kernel, bandPartOf(answers, sizes), 1);
    this.factors = new Float64Array(12 * answers.numbers.handles);
    this.mapped = new Float64Array(answers.band.steps.length);
    this.bandMm = new Float32Array(answers.regions.length);
  }

  evaluate(poses: readonly Pose[]): Float32Array {
    const { factors, mapped, free, bandMm } = this;
    writeElasticFactors(poses, this.answers.origins, this.motion, factors);
    for (let c = 0; c < mapped.length; ++c) {
      let sum = 0;
      for (let j = 0; j < factors.length; ++j) sum += this.answers.bandMap[c * factors.length + j] * factors[j];
      mapped[c] = sum;
    }
    this.matrix.multiply(mapped, 0);
    for (let v = 0; v < free.length; ++v) bandMm[free[v]] = this.ofVertex(v);
    return bandMm;
  }

  private ofVertex(vertex: number): number {
    const { sums } = this.matrix;
    const rows = 3 * this.free.length;
    let xx = 0, yy = 0, zz = 0, xy = 0, xz = 0, yz = 0;
    for (let i = 0, at = 3 * vertex; i < this.variables; ++i, at += rows) {
      const x = sums[at], y = sums[at + 1], z = sums[at + 2];
      xx += x * x;
      yy += y * y;
      zz += z * z;
      xy += x * y;
      xz += x * z;
      yz += y * z;
    }
    const squares = xx * xx + yy * yy + zz * zz + 2 * (xy * xy + xz * xz + yz * yz);
    if (squares <= 0) return 0;
    const trace = xx + yy + zz;
    const x = Math.min(3, Math.max(1, (trace * trace) / squares)) - 2;
    return Math.sqrt(squares / trace) * (OF_TWO + 0.5 * (OF_THREE - OF_ONE) * x + 0.5 * (OF_ONE - 2 * OF_TWO + OF_THREE) * x * x);
  }
}
