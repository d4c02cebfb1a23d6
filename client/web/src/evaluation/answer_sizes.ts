// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { AnswerModel, type PreparedColumns } from "./prepared_columns";

/** How many there are of what is not written down by itself. */
export interface AnswerSizes {
  /** Vertices that are free. */
  free: number;
  /** Numbers a factor: 3 of gradient_field, otherwise 1. */
  width: number;
  /** Of the columns. */
  rows: number;
  /** Before the map, and after it. */
  factors: number;
  columns: number;
  nodes: number;
  pairs: number;
  triples: number;
  /** Of the band of uncertainty. */
  bandVariables: number;
}

export function sizesOf(answers: PreparedColumns): AnswerSizes {
  const { model, handles, polynomials } = answers.numbers;
  const free = answers.freeRest.length / 3;
  const isGradient = model === AnswerModel.GRADIENT_FIELD;
  const numbers = 6 * handles;
  const pairs = model === AnswerModel.NEO_HOOKEAN ? (numbers * (numbers + 1)) / 2 : 0;
  const triples = answers.thirdLengths.length > 0 ? (pairs * (numbers + 2)) / 3 : 0;
  return {
    free,
    width: isGradient ? 3 : 1,
    rows: isGradient ? free : 3 * free,
    factors: isGradient ? 3 * polynomials + 4 * handles : 12 * handles + pairs + triples,
    columns: answers.columns.steps.length,
    nodes: isGradient ? answers.nodes.length / handles : 0,
    pairs,
    triples,
    bandVariables: free > 0 && answers.band.steps.length > 0 ? Math.floor(answers.band.upper.length / answers.band.steps.length / (3 * free)) : 0,
  };
}
