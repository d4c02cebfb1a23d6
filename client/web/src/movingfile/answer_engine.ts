// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { makeEvaluator } from "../evaluation/evaluator";
import type { Pose } from "../geometry/pose";

/** Where the vertices are that surfaces follow. */
export interface Answer {
  /** #V by 3, mm, LPS. */
  positions: Float32Array;
  errorBoundMm: number;
  /** The error is an estimate and no bound. */
  isEstimate: boolean;
  /** Of each vertex the band of 95 in 100, mm; null where the answers know none. */
  uncertainty: Float32Array | null;
}

export interface OpenAnswers {
  /** One pose for each handle; null where the answers do not reach. */
  evaluate(poses: Pose[]): Answer | null;
  /** By the browser's vectors, not by JavaScript alone. */
  isFast: boolean;
}

export async function openAnswers(bytes: Uint8Array<ArrayBuffer>): Promise<OpenAnswers> {
  const evaluator = await makeEvaluator(bytes);
  const evaluate = (poses: Pose[]) => {
    const { coverage, ...answer } = evaluator.evaluate(poses);
    return coverage === "beyond" ? null : answer;
  };
  return { evaluate, isFast: evaluator.kernel.name === "webassembly" };
}
