// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Pose } from "../geometry/pose";
import { sizesOf } from "./answer_sizes";
import { Motion, rowNorm } from "./motion";
import { AnswerModel, type PreparedColumns } from "./prepared_columns";

// Bounds of docs/prepared-answers.md, "Errors, and what is covered".

const HALF_UNIT_HELD = 5.97e-8;
const HALF_UNIT = 5.98e-8;
const BOUND_ROUNDING = 1 + 1e-4;
const UPPER = 65536;

const LARGEST_ANGLE = 1e6;
const LARGEST_LENGTH_MM = 1e9;
const LARGEST_SCALE = 1e6;
const RANGE_SLACK = 1e-9;

/** A pose for every handle, of numbers so far from overflowing that positions are finite. */
export function areLegal(answers: PreparedColumns, poses: readonly Pose[]): boolean {
  if (poses.length !== answers.numbers.handles) return false;
  for (const pose of poses) {
    for (let k = 0; k < 3; ++k) {
      if (!(Math.abs(pose.rotationVector[k]) <= LARGEST_ANGLE)) return false;
      if (!(Math.abs(pose.pivotMm[k]) <= LARGEST_LENGTH_MM) || !(Math.abs(pose.translationMm[k]) <= LARGEST_LENGTH_MM)) return false;
    }
    if (!(pose.scale > 0 && pose.scale <= LARGEST_SCALE)) return false;
  }
  return true;
}

/** Whether legal poses with that error lie in the prepared range; its edge belongs to it. */
export function areCovered({ numbers }: PreparedColumns, poses: readonly Pose[], errorMm: number): boolean {
  if (numbers.model === AnswerModel.LINEAR_ELASTIC) return errorMm <= numbers.toleranceMm;
  const isNeo = numbers.model === AnswerModel.NEO_HOOKEAN;
  for (const { rotationVector: w, scale } of poses) {
    const keepsSize = isNeo ? scale === 1 : Math.abs(scale - 1) <= numbers.maxScaleChange + RANGE_SLACK;
    const angle = Math.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
    if (!keepsSize || !(angle <= numbers.maxRotation * (1 + RANGE_SLACK))) return false;
  }
  return errorMm <= (isNeo ? numbers.maxEstimateMm : numbers.toleranceMm);
}

/** Beyond this turn, 30 degrees, there is no band, whatever was prepared: linear elasticity takes the turn for strain. */
export const LARGEST_BAND_ROTATION = 0.524;

/** Whether no handle turns too far for a band. */
export function haveBand({ numbers }: PreparedColumns, poses: readonly Pose[]): boolean {
  const most = Math.min(numbers.maxRotation, LARGEST_BAND_ROTATION) * (1 + RANGE_SLACK);
  for (const { rotationVector: w } of poses) {
    if (!(Math.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]) <= most)) return false;
  }
  return true;
}

/** How far a free vertex of gradient_field or linear_elastic can be put off by compression and single precision. */
export class CompressionError {
  private readonly sums = new Float64Array(3);
  private readonly sizes;
  private readonly onlyUpper: number;

  constructor(private readonly answers: PreparedColumns) {
    this.sizes = sizesOf(answers);
    const { rows, columns } = this.sizes;
    this.onlyUpper = rows > 0 ? columns - answers.columns.lower.length / rows : columns;
  }

  /** `factors`: as they go into the map, `mapped`: as they come out. */
  of(factors: Float64Array, mapped: Float64Array): number {
    const { width, columns } = this.sizes;
    const { gains, numbers, columns: packed } = this.answers;
    const halfStep = (width === 3 ? 0.5 : 0.5 * Math.sqrt(3)) * UPPER;
    let [digits, sum, partialSums] = [0, 0, 0];
    for (let c = 0; c < columns; ++c) {
      const size = rowNorm(mapped, c * width, width);
      if (c < this.onlyUpper) digits += halfStep * packed.steps[c] * size;
      sum += size * gains[c];
      partialSums += sum;
    }
    return this.cut(factors) + digits + HALF_UNIT * (4 * sum + partialSums + 2 * numbers.largestRestMm);
  }

  private cut(factors: Float64Array): number {
    const { cutMap, tail } = this.answers;
    const { width, factors: count } = this.sizes;
    const { sums } = this;
    let error = 0;
    for (let first = 0; first < cutMap.length; first += count) {
      sums.fill(0);
      for (let j = 0; j < count; ++j) {
        for (let f = 0; f < width; ++f) sums[f] += cutMap[first + j] * factors[j * width + f];
      }
      error += rowNorm(sums, 0, width);
    }
    for (let j = 0; j < count; ++j) error += tail[j] * rowNorm(factors, j * width, width);
    return BOUND_ROUNDING * error;
  }
}

/** What rounding does to vertices that are not free. */
export class HeldError {
  private largestFixedMm = 0;
  /** Of each handle a ball around its vertices: middle, and radius; NaN without vertices. */
  private readonly middles: Float64Array;
  private readonly radii: Float64Array;
  private readonly motion = new Motion();

  constructor({ numbers, regions, handleRest, fixedRest }: PreparedColumns) {
    const low = new Float64Array(3 * numbers.handles).fill(Infinity);
    const high = new Float64Array(3 * numbers.handles).fill(-Infinity);
    let at = 0;
    for (const handle of regions) {
      if (handle < 0) continue;
      for (let k = 0; k < 3; ++k, ++at) {
        low[3 * handle + k] = Math.min(low[3 * handle + k], handleRest[at]);
        high[3 * handle + k] = Math.max(high[3 * handle + k], handleRest[at]);
      }
    }
    this.middles = low.map((value, i) => (value + high[i]) / 2);
    const half = low.map((value, i) => (high[i] - value) / 2);
    this.radii = Float64Array.from({ length: numbers.handles }, (_, h) => rowNorm(half, 3 * h, 3));
    for (let i = 0; i < fixedRest.length; i += 3) {
      this.largestFixedMm = Math.max(this.largestFixedMm, Math.hypot(fixedRest[i], fixedRest[i + 1], fixedRest[i + 2]));
    }
  }

  of(poses: readonly Pose[]): number {
    const { middles, radii, motion } = this;
    let largest = this.largestFixedMm;
    for (let h = 0; h < poses.length; ++h) {
      if (!Number.isFinite(radii[h])) continue;
      motion.set(poses[h], middles, 3 * h);
      for (let k = 0; k < 3; ++k) motion.move[k] += middles[3 * h + k];
      largest = Math.max(largest, rowNorm(motion.move, 0, 3) + poses[h].scale * radii[h]);
    }
    return HALF_UNIT_HELD * largest;
  }
}
