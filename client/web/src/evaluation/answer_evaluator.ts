// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Pose } from "../geometry/pose";

/** Why prepared answers cannot be evaluated here, in one line. */
export class EvaluationError extends Error {
  override readonly name: string = "EvaluationError";
}

/** What client/web/wasm/answer_evaluator.cc exports; numbers are addresses in `memory` where C++ has pointers. */
export interface EvaluatorExports {
  memory: WebAssembly.Memory;
  _initialize(): void;
  reserve(size: number): number;
  open(): number;
  message(): number;
  num_handles(): number;
  num_vertices(): number;
  is_estimate(): number;
  has_band(): number;
  poses(): number;
  evaluate(): number;
  error_mm(): number;
  positions(): number;
  places(count: number): number;
  choose(): number;
  evaluate_chosen(): number;
  evaluate_band(): number;
  band_mm(): number;
  evaluate_contact(): number;
  contact_forces(): number;
  seal_pairs(): number;
  seal_parted_mm(): number;
  seal_released(): number;
}

/** Of other poses than those of the hand: of every vertex its place or the band in mm, of every contact row that may lift off the force in N, or of sealed lips how far they are parted in mm before and whether (1) that is too far for a seal. */
export type ValueKind = "positions" | "band" | "contact" | "seal";

/** One Pa mm², in N. */
const FORCE_UNIT_N = 1e-6;

const MOST_ANSWER_BYTES = 2 ** 28;

/** No band for larger rotations (30 degrees), even if they were prepared: linear elasticity counts the rotation as strain. */
export const LARGEST_BAND_ROTATION = 0.524;

/** What poses give. */
export interface Evaluation {
  /** x y z of every vertex in mm; the evaluator's own array, which the next evaluation overwrites. As before where not covered; zeros at first. */
  positions: Float32Array;
  /** "beyond": these poses are not what was prepared; ask the server. */
  coverage: "covered" | "beyond";
  /** Of every position, mm; infinite for invalid poses. */
  errorBoundMm: number;
  /** Of neo_hookean the error is an estimate and no bound. */
  isEstimate: boolean;
  /** Of every vertex the band in mm, with columns of it; the evaluator's own array. */
  uncertainty: Float32Array | null;
}

const AT_REST: Pose = { rotationVector: [0, 0, 0], pivotMm: [0, 0, 0], translationMm: [0, 0, 0], scale: 1 };
const POSE_NUMBERS = 10;
const TRIALS = 15;

/**
 * Prepared answers at work (docs/prepared-answers.md): the positions that the server gives, by all of the columns. The work is done
 * by core/mechanics/answer_evaluator, compiled to WebAssembly; each evaluator is an instance of its own.
 */
export class AnswerEvaluator {
  private readonly handles: number;
  private readonly bandMm: Float32Array | null;
  private readonly result: Evaluation;
  /** Those of the last `placesAt`, and where their positions are written. */
  private chosen: { vertices: Int32Array; address: number } = { vertices: new Int32Array(), address: 0 };

  /**
   * `module`: of evaluatorModule, perhaps in another thread. `sha256`: of the bytes, 64 hexadecimal digits; not compared where it is
   * left out, nor on a page without WebCrypto (not opened by https). `bytes` stay the caller's.
   *
   * Rejects with an EvaluationError: a wrong hash, bytes that are cut off, damaged or too large.
   */
  static async open(bytes: Uint8Array, module: WebAssembly.Module, sha256?: string): Promise<AnswerEvaluator> {
    if (bytes.length > MOST_ANSWER_BYTES) throw new EvaluationError(`prepared answers of ${bytes.length} bytes; at most ${MOST_ANSWER_BYTES} are read`);
    if (sha256 !== undefined && globalThis.crypto?.subtle !== undefined && (await sha256Of(bytes)) !== sha256.toLowerCase()) {
      throw new EvaluationError("prepared answers do not match the announced SHA-256; fetch them again");
    }
    const { exports: all } = await WebAssembly.instantiate(module);
    const exports = all as unknown as EvaluatorExports;
    exports._initialize();
    readInto(exports, bytes);
    return new AnswerEvaluator(exports);
  }

  private constructor(private readonly exports: EvaluatorExports) {
    const vertices = exports.num_vertices();
    this.handles = exports.num_handles();
    this.bandMm = exports.has_band() !== 0 ? new Float32Array(vertices) : null;
    this.result = { positions: new Float32Array(3 * vertices), coverage: "beyond", errorBoundMm: 0, isEstimate: exports.is_estimate() !== 0, uncertainty: null };
  }

  /** How long one evaluation takes here, in ms: the median of a few at rest. */
  measure(now: () => number): number {
    const rest = Array.from({ length: this.handles }, () => AT_REST);
    const times = Array.from({ length: TRIALS }, () => {
      const start = now();
      this.evaluate(rest);
      return now() - start;
    });
    return times.sort((a, b) => a - b)[Math.floor(TRIALS / 2)];
  }

  /** `poses`: one for every handle, in their order. The object that is returned is the same every time. */
  evaluate(poses: readonly Pose[], withBand = true): Evaluation {
    const { exports, result } = this;
    const isCovered = this.setPoses(poses) && exports.evaluate() !== 0;
    result.coverage = isCovered ? "covered" : "beyond";
    result.errorBoundMm = poses.length === this.handles ? exports.error_mm() : Infinity;
    if (!isCovered) return result;
    this.copy(exports.positions(), result.positions);
    result.uncertainty = withBand ? this.band() : null;
    return result;
  }

  /** In an array of the caller's; null: no such columns, invalid poses, too large a turn (band), poses that are not covered (positions). */
  valuesAt(poses: readonly Pose[], kind: ValueKind): Float32Array | null {
    if (!this.setPoses(poses)) return null;
    if (kind === "positions") return this.places();
    if (kind === "seal") return this.seal();
    return kind === "band" ? (this.band()?.slice() ?? null) : this.contactForces();
  }

  /** Of each set of poses where these vertices are, three numbers each, the same as of `evaluate`; null where one is not covered. Costs little for each set. */
  placesAt(poseSets: readonly (readonly Pose[])[], vertices: Int32Array): Float32Array | null {
    const { exports } = this;
    if (this.chosen.vertices.join() !== vertices.join()) this.chosen = { vertices, address: this.choose(vertices) };
    const { address } = this.chosen;
    const size = 3 * vertices.length;
    const places = new Float32Array(size * poseSets.length);
    for (const [set, poses] of poseSets.entries()) {
      if (!this.setPoses(poses) || exports.evaluate_chosen() === 0) return null;
      places.set(new Float32Array(exports.memory.buffer, address, size), set * size);
    }
    return places;
  }

  private choose(vertices: Int32Array): number {
    const { exports } = this;
    new Int32Array(exports.memory.buffer, exports.places(vertices.length), vertices.length).set(vertices);
    return exports.choose();
  }

  private setPoses(poses: readonly Pose[]): boolean {
    if (poses.length !== this.handles) return false;
    const numbers = new Float64Array(this.exports.memory.buffer, this.exports.poses(), POSE_NUMBERS * this.handles);
    poses.forEach(({ rotationVector, pivotMm, translationMm, scale }, handle) => {
      numbers.set([...rotationVector, ...pivotMm, ...translationMm, scale], POSE_NUMBERS * handle);
    });
    return true;
  }

  private places(): Float32Array | null {
    if (this.exports.evaluate() === 0) return null;
    const places = new Float32Array(this.result.positions.length);
    this.copy(this.exports.positions(), places);
    return places;
  }

  private band(): Float32Array | null {
    if (this.bandMm === null || this.exports.evaluate_band() === 0) return null;
    this.copy(this.exports.band_mm(), this.bandMm);
    return this.bandMm;
  }

  private contactForces(): Float32Array | null {
    const rows = this.exports.evaluate_contact();
    if (rows === 0) return null;
    return Float32Array.from(new Float64Array(this.exports.memory.buffer, this.exports.contact_forces(), rows), (force) => FORCE_UNIT_N * force);
  }

  private seal(): Float32Array | null {
    this.exports.evaluate_contact();
    return this.exports.seal_pairs() === 0 ? null : Float32Array.of(this.exports.seal_parted_mm(), this.exports.seal_released());
  }

  /** The memory may grow at any call, which detaches its old arrays: so callers get a copy. */
  private copy(address: number, out: Float32Array): void {
    out.set(new Float32Array(this.exports.memory.buffer, address, out.length));
  }
}

function readInto(exports: EvaluatorExports, bytes: Uint8Array): void {
  let isGood: boolean;
  try {
    const address = exports.reserve(bytes.length);
    new Uint8Array(exports.memory.buffer, address, bytes.length).set(bytes);
    isGood = exports.open() !== 0;
  } catch {
    throw new EvaluationError(`prepared answers of ${bytes.length} bytes need more memory than this browser gives`);
  }
  if (isGood) return;
  const text = new Uint8Array(exports.memory.buffer, exports.message());
  throw new EvaluationError(new TextDecoder().decode(text.slice(0, text.indexOf(0))));
}

async function sha256Of(bytes: Uint8Array): Promise<string> {
  const digest = new Uint8Array(await crypto.subtle.digest("SHA-256", bytes as Uint8Array<ArrayBuffer>));
  return Array.from(digest, (byte) => byte.toString(16).padStart(2, "0")).join("");
}
