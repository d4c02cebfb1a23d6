// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { AnswerEvaluator } from "../evaluation/answer_evaluator";
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
}

export async function openAnswers(bytes: Uint8Array<ArrayBuffer>, module: WebAssembly.Module): Promise<OpenAnswers> {
  const evaluator = await AnswerEvaluator.open(bytes, module);
  const evaluate = (poses: Pose[]) => {
    const { coverage, ...answer } = evaluator.evaluate(poses);
    return coverage === "beyond" ? null : answer;
  };
  return { evaluate };
}
