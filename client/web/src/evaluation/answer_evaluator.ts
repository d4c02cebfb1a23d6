// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Pose } from "../geometry/pose";
import { AnswerBand } from "./answer_band";
import { CompressionError, HeldError, areCovered, areLegal, haveBand } from "./answer_errors";
import { type AnswerSizes, sizesOf } from "./answer_sizes";
import { type ColumnKernel, javascriptKernel } from "./column_kernel";
import { ColumnMatrix, partsOf, unpack, wholeOf } from "./column_matrix";
import { Motion } from "./motion";
import { type PoseFactors, makePoseFactors } from "./pose_factors";
import { AnswerModel, FIXED, FREE, type PreparedColumns } from "./prepared_columns";

/** What poses give. */
export interface Evaluation {
  /** x y z of every vertex in mm; the evaluator's own array, which the next evaluation overwrites. As before where not covered. */
  positions: Float32Array;
  /** "beyond": these poses are not what was prepared; ask the server. */
  coverage: "covered" | "beyond";
  /** Of every position, mm; infinite for poses that are none. */
  errorBoundMm: number;
  /** Of neo_hookean the error is an estimate and no bound. */
  isEstimate: boolean;
  /** Of every vertex the band in mm, with columns of it; the evaluator's own array. */
  uncertainty: Float32Array | null;
}

const ORIGIN = new Float64Array(3);
const AT_REST: Pose = { rotationVector: [0, 0, 0], pivotMm: [0, 0, 0], translationMm: [0, 0, 0], scale: 1 };
const TRIALS = 15;

/**
 * Prepared answers at work (docs/prepared-answers.md): the positions that the server gives, by all of the columns. Nothing is
 * allocated by a pose.
 */
export class AnswerEvaluator {
  private readonly sizes: AnswerSizes;
  private readonly factors: PoseFactors;
  private readonly heldError: HeldError;
  private readonly compressionError: CompressionError;
  /** Row-major; and what it gives. */
  private readonly map: Float64Array;
  private readonly mapped: Float64Array;
  private readonly matrices: ColumnMatrix[];
  private readonly firstColumns: number[];
  private readonly places: Places;
  private readonly band: AnswerBand | null;
  private readonly motions: Motion[];
  private readonly result: Evaluation;

  /** `answers`: of readAnswers. */
  constructor(
    readonly answers: PreparedColumns,
    readonly kernel: ColumnKernel = javascriptKernel,
  ) {
    this.sizes = sizesOf(answers);
    this.factors = makePoseFactors(answers);
    this.heldError = new HeldError(answers);
    this.compressionError = new CompressionError(answers);
    this.map = this.isClustered ? unpackedMap(answers, this.sizes) : answers.map;
    this.mapped = new Float64Array(this.sizes.columns * this.sizes.width);
    const parts = partsOf(answers, this.sizes.rows);
    this.matrices = parts.map((part) => new ColumnMatrix(kernel, part, this.sizes.width));
    this.firstColumns = parts.map((part) => part.firstColumn);
    this.places = placesOf(answers);
    this.band = this.sizes.bandVariables > 0 ? new AnswerBand(answers, this.places.free, kernel) : null;
    this.motions = Array.from({ length: answers.numbers.handles }, () => new Motion());
    const positions = restPositions(answers, this.places);
    this.result = { positions, coverage: "covered", errorBoundMm: 0, isEstimate: this.isClustered, uncertainty: null };
  }

  /** How long one evaluation takes here, in ms: the median of a few at rest. */
  measure(now: () => number): number {
    const rest = Array.from({ length: this.answers.numbers.handles }, () => AT_REST);
    const times = Array.from({ length: TRIALS }, () => {
      const start = now();
      this.evaluate(rest);
      return now() - start;
    });
    return times.sort((a, b) => a - b)[Math.floor(TRIALS / 2)];
  }

  get model(): AnswerModel {
    return this.answers.numbers.model;
  }

  /** `poses`: one for every handle, in their order. The object that is returned is the same every time. */
  evaluate(poses: readonly Pose[], withBand = true): Evaluation {
    const { result } = this;
    result.errorBoundMm = areLegal(this.answers, poses) ? this.multiplyMap(poses) : Infinity;
    result.coverage = result.errorBoundMm < Infinity && areCovered(this.answers, poses, result.errorBoundMm) ? "covered" : "beyond";
    if (result.coverage === "beyond") return result;
    this.matrices.forEach((matrix, i) => matrix.multiply(this.mapped, this.firstColumns[i]));
    if (this.isClustered) this.placeClusters();
    else this.placeFree();
    this.placeHandles(poses);
    result.uncertainty = withBand && this.band !== null && haveBand(this.answers, poses) ? this.band.evaluate(poses) : null;
    return result;
  }

  /** The band alone, of poses that need not be covered, in an array of the caller's; null without columns of it, for poses that are none, and where one turns too far. */
  bandAt(poses: readonly Pose[]): Float32Array | null {
    return this.band === null || !areLegal(this.answers, poses) || !haveBand(this.answers, poses) ? null : this.band.evaluate(poses).slice();
  }

  private get isClustered(): boolean {
    return this.model === AnswerModel.NEO_HOOKEAN;
  }

  /** Factors of the columns; returns the error. */
  private multiplyMap(poses: readonly Pose[]): number {
    this.factors.set(poses);
    const { mapped } = this;
    const { factors } = this.factors;
    if (this.sizes.width === 3) multiplyByThree(this.map, factors, mapped);
    else multiplyByOne(this.map, factors, mapped);
    const compression = this.isClustered ? 0 : this.compressionError.of(factors, mapped);
    return Math.max(this.factors.modelErrorMm + compression, this.heldError.of(poses));
  }

  private placeFree(): void {
    const { free } = this.places;
    const { freeRest } = this.answers;
    const { positions } = this.result;
    const { sums, stride } = this.matrices[0];
    const isPlanar = this.sizes.width === 3;
    const vertex = isPlanar ? 1 : 3;
    const axis = isPlanar ? stride : 1;
    for (let i = 0; i < free.length; ++i) {
      const at = 3 * free[i], from = vertex * i;
      positions[at] = freeRest[3 * i] + sums[from];
      positions[at + 1] = freeRest[3 * i + 1] + sums[from + axis];
      positions[at + 2] = freeRest[3 * i + 2] + sums[from + 2 * axis];
    }
  }

  private placeClusters(): void {
    const { free } = this.places;
    const { freeRest, clusters, clusterVertices } = this.answers;
    const { positions } = this.result;
    for (let k = 0, first = 0; k < this.matrices.length; ++k) {
      const { sums } = this.matrices[k];
      const count = clusters[3 * k];
      for (let i = 0; i < count; ++i) {
        const vertex = clusterVertices[first + i];
        const at = 3 * free[vertex], rest = 3 * vertex;
        positions[at] = freeRest[rest] + sums[3 * i];
        positions[at + 1] = freeRest[rest + 1] + sums[3 * i + 1];
        positions[at + 2] = freeRest[rest + 2] + sums[3 * i + 2];
      }
      first += count;
    }
  }

  private placeHandles(poses: readonly Pose[]): void {
    const { held } = this.places;
    const { regions, handleRest } = this.answers;
    const { positions } = this.result;
    for (let h = 0; h < poses.length; ++h) this.motions[h].set(poses[h], ORIGIN, 0);
    for (let i = 0; i < held.length; ++i) {
      const { turn, move } = this.motions[regions[held[i]]];
      const x = handleRest[3 * i], y = handleRest[3 * i + 1], z = handleRest[3 * i + 2];
      const at = 3 * held[i];
      positions[at] = x + turn[0] * x + turn[1] * y + turn[2] * z + move[0];
      positions[at + 1] = y + turn[3] * x + turn[4] * y + turn[5] * z + move[1];
      positions[at + 2] = z + turn[6] * x + turn[7] * y + turn[8] * z + move[2];
    }
  }
}

// Four sums at a time do not wait for each other; a row is read once for all three numbers of a factor.

/** product = map * factors, a number a row. */
function multiplyByOne(map: Float64Array, factors: Float64Array, product: Float64Array): void {
  const count = factors.length;
  const whole = count - (count % 4);
  for (let c = 0, at = 0; c < product.length; ++c, at += count) {
    let p = 0, q = 0, r = 0, s = 0;
    for (let j = 0; j < whole; j += 4) {
      p += map[at + j] * factors[j];
      q += map[at + j + 1] * factors[j + 1];
      r += map[at + j + 2] * factors[j + 2];
      s += map[at + j + 3] * factors[j + 3];
    }
    for (let j = whole; j < count; ++j) p += map[at + j] * factors[j];
    product[c] = p + q + (r + s);
  }
}

/** The same with rows of three. */
function multiplyByThree(map: Float64Array, factors: Float64Array, product: Float64Array): void {
  const count = factors.length / 3;
  for (let c = 0, at = 0; c < product.length; c += 3, at += count) {
    let x = 0, y = 0, z = 0;
    for (let j = 0, k = 0; j < count; ++j, k += 3) {
      const entry = map[at + j];
      x += entry * factors[k];
      y += entry * factors[k + 1];
      z += entry * factors[k + 2];
    }
    product[c] = x;
    product[c + 1] = y;
    product[c + 2] = z;
  }
}

/** Which vertices of the answer are free, fixed and of handles, in the order of the answer. */
interface Places {
  free: Uint32Array;
  fixed: Uint32Array;
  held: Uint32Array;
}

function placesOf({ regions }: PreparedColumns): Places {
  const where = (wanted: (region: number) => boolean) => {
    const places: number[] = [];
    regions.forEach((region, place) => wanted(region) && places.push(place));
    return Uint32Array.from(places);
  };
  return { free: where((region) => region === FREE), fixed: where((region) => region === FIXED), held: where((region) => region >= 0) };
}

function restPositions({ regions, freeRest, fixedRest, handleRest }: PreparedColumns, places: Places): Float32Array {
  const positions = new Float32Array(3 * regions.length);
  const scatter = (rest: ArrayLike<number>, at: Uint32Array) => {
    for (let i = 0; i < at.length; ++i) for (let k = 0; k < 3; ++k) positions[3 * at[i] + k] = rest[3 * i + k];
  };
  scatter(freeRest, places.free);
  scatter(fixedRest, places.fixed);
  scatter(handleRest, places.held);
  return positions;
}

function unpackedMap(answers: PreparedColumns, { columns, factors }: AnswerSizes): Float64Array {
  const map = new Float64Array(columns * factors);
  unpack(wholeOf(answers.clusterMap, columns), (row, column, value) => (map[row * factors + column] = value));
  return map;
}
