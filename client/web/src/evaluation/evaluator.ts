// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { AnswersError, MOST_ANSWER_BYTES, readAnswers } from "./answer_bytes";
import { AnswerEvaluator } from "./answer_evaluator";
import { type ColumnKernel, javascriptKernel } from "./column_kernel";
import { floatsOf } from "./column_matrix";
import { webassemblyKernel } from "./webassembly_kernel";

export interface EvaluatorOptions {
  /** The bytes' SHA-256 as 64 hexadecimal digits. Not compared where it is left out, nor on a page without WebCrypto (not opened by https). */
  sha256?: string;
  mostBytes?: number;
  /** WebAssembly where the browser has it, else JavaScript. */
  kernel?: ColumnKernel;
}

/** Rejects with an AnswersError: a wrong hash, bytes that are cut off, damaged or too large. */
export async function makeEvaluator(bytes: Uint8Array, options: EvaluatorOptions = {}): Promise<AnswerEvaluator> {
  const { sha256, mostBytes = MOST_ANSWER_BYTES, kernel } = options;
  const isCompared = sha256 !== undefined && bytes.length <= mostBytes && globalThis.crypto?.subtle !== undefined;
  if (isCompared && (await sha256Of(bytes)) !== sha256.toLowerCase()) {
    throw new AnswersError("prepared answers do not match the announced SHA-256; fetch them again");
  }
  const answers = readAnswers(bytes, mostBytes);
  return new AnswerEvaluator(answers, kernel ?? (await webassemblyKernel(floatsOf(answers))) ?? javascriptKernel);
}

async function sha256Of(bytes: Uint8Array): Promise<string> {
  const digest = new Uint8Array(await crypto.subtle.digest("SHA-256", bytes as Uint8Array<ArrayBuffer>));
  return Array.from(digest, (byte) => byte.toString(16).padStart(2, "0")).join("");
}
