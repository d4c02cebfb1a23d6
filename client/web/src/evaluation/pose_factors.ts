// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Pose } from "../geometry/pose";
import { ElasticFactors } from "./elastic_factors";
import { GradientFactors } from "./gradient_factors";
import { AnswerModel, type PreparedColumns } from "./prepared_columns";

/** What poses become before the columns: rows of one number, of gradient_field of three. Written in place. */
export interface PoseFactors {
  readonly factors: Float64Array;
  /** Of the newest poses: what the model's expansion leaves out, mm. */
  readonly modelErrorMm: number;
  set(poses: readonly Pose[]): void;
}

export function makePoseFactors(answers: PreparedColumns): PoseFactors {
  return answers.numbers.model === AnswerModel.GRADIENT_FIELD ? new GradientFactors(answers) : new ElasticFactors(answers);
}
