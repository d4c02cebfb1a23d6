// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { expect, test } from "vitest";
import { readAnswers } from "../../src/evaluation/answer_bytes";
import { AnswerEvaluator } from "../../src/evaluation/answer_evaluator";
import type { Pose } from "../../src/geometry/pose";
import { GOLDEN, goldenBytes, goldenCases } from "./golden_answers";

const AGREEMENT_MM = 1e-4;

const largestOff = (positions: Float32Array, expected: number[]) => expected.reduce((most, value, i) => Math.max(most, Math.abs(value - positions[i])), 0);

test.each(GOLDEN)("%s gives the positions and errors that are written there", (name) => {
  const evaluator = new AnswerEvaluator(readAnswers(goldenBytes(name)));
  const cases = goldenCases(name);
  expect(cases.length).toBe(8);
  for (const { poses, isCovered, errorMm, positionsMm } of cases) {
    const { positions, coverage, errorBoundMm } = evaluator.evaluate(poses);
    expect(coverage).toBe(isCovered ? "covered" : "beyond");
    expect(Math.abs(errorBoundMm - errorMm)).toBeLessThanOrEqual(1e-6 * errorMm + 1e-9);
    if (!isCovered) continue;
    expect(positions.length).toBe(positionsMm.length);
    expect(largestOff(positions, positionsMm)).toBeLessThanOrEqual(AGREEMENT_MM);
  }
});

test.each(GOLDEN)("%s: what was asked before does not matter", (name) => {
  const evaluator = new AnswerEvaluator(readAnswers(goldenBytes(name)));
  for (const { poses, isCovered, positionsMm } of goldenCases(name).reverse()) {
    const { positions } = evaluator.evaluate(poses);
    if (isCovered) expect(largestOff(positions, positionsMm)).toBeLessThanOrEqual(AGREEMENT_MM);
  }
});

test("poses that are none are beyond what is covered, and leave the positions as they were", () => {
  const evaluator = new AnswerEvaluator(readAnswers(goldenBytes("linear_elastic")));
  const before = Float32Array.from(evaluator.evaluate(goldenCases("linear_elastic")[1].poses).positions);
  const rest: Pose = { rotationVector: [0, 0, 0], pivotMm: [0, 0, 0], translationMm: [0, 0, 0], scale: 1 };
  const bad: Pose[][] = [[], [rest], [rest, rest, rest], [rest, { ...rest, scale: 0 }], [rest, { ...rest, scale: NaN }], [{ ...rest, translationMm: [Infinity, 0, 0] }, rest]];
  for (const poses of bad) {
    const evaluation = evaluator.evaluate(poses);
    expect(evaluation.coverage).toBe("beyond");
    expect(evaluation.errorBoundMm).toBe(Infinity);
    expect(evaluation.positions).toEqual(before);
  }
});
