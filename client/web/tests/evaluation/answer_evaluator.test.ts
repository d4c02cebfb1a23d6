// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { expect, test, vi } from "vitest";
import { readAnswers } from "../../src/evaluation/answer_bytes";
import { AnswerEvaluator } from "../../src/evaluation/answer_evaluator";
import { javascriptKernel } from "../../src/evaluation/column_kernel";
import { makeEvaluator } from "../../src/evaluation/evaluator";
import type { Pose } from "../../src/geometry/pose";
import { GOLDEN, goldenBytes, goldenCases } from "./golden_answers";

const AGREEMENT_MM = 1e-4;
const BAND_AGREEMENT_MM = 2e-3;

const largestOff = (positions: Float32Array, expected: number[]) => expected.reduce((most, value, i) => Math.max(most, Math.abs(value - positions[i])), 0);

const KERNELS = ["javascript", "webassembly"] as const;
const ALL = GOLDEN.flatMap((name) => KERNELS.map((kernel) => ({ name, kernel })));

async function evaluatorOf(name: string, kernel: (typeof KERNELS)[number]): Promise<AnswerEvaluator> {
  const evaluator = await makeEvaluator(goldenBytes(name), kernel === "javascript" ? { kernel: javascriptKernel } : {});
  expect(evaluator.kernel.name).toBe(kernel);
  return evaluator;
}

test.each(ALL)("$name gives the positions, errors and bands that are written there, by $kernel", async ({ name, kernel }) => {
  const evaluator = await evaluatorOf(name, kernel);
  const cases = goldenCases(name);
  expect(cases.length).toBe(8);
  for (const { poses, isCovered, errorMm, positionsMm, bandMm } of cases) {
    const { positions, coverage, errorBoundMm, uncertainty } = evaluator.evaluate(poses);
    expect(coverage).toBe(isCovered ? "covered" : "beyond");
    expect(Math.abs(errorBoundMm - errorMm)).toBeLessThanOrEqual(1e-6 * errorMm + 1e-9);
    if (!isCovered) continue;
    expect(positions.length).toBe(positionsMm.length);
    expect(largestOff(positions, positionsMm)).toBeLessThanOrEqual(AGREEMENT_MM);
    expect(uncertainty === null).toBe(bandMm === null);
    if (uncertainty !== null && bandMm !== null) expect(largestOff(uncertainty, bandMm)).toBeLessThanOrEqual(BAND_AGREEMENT_MM);
  }
});

test.each(KERNELS)("a handle that turns beyond the range has positions and no band, by %s", async (kernel) => {
  const evaluator = await evaluatorOf("linear_elastic_band", kernel);
  const cases = goldenCases("linear_elastic_band");
  expect(Math.hypot(...cases[7].poses[0].rotationVector)).toBeCloseTo(0.42);
  expect(evaluator.evaluate(cases[7].poses)).toMatchObject({ coverage: "covered", uncertainty: null });
  expect(evaluator.bandAt(cases[7].poses)).toBeNull();
  expect(evaluator.bandAt(cases[1].poses)?.length).toBe(cases[1].bandMm?.length);
});

test.each(GOLDEN)("%s: a thousand poses give the same by JavaScript and by WebAssembly", async (name) => {
  const [one, other] = await Promise.all(KERNELS.map((kernel) => evaluatorOf(name, kernel)));
  const [from, to] = goldenCases(name).filter(({ isCovered }) => isCovered).slice(1, 3);
  for (let step = 0; step < 1000; ++step) {
    const share = step / 1000;
    const mix = (a: readonly number[], b: readonly number[]) => a.map((value, k) => value + share * (b[k] - value)) as [number, number, number];
    const poses = from.poses.map((pose, h) => ({
      rotationVector: mix(pose.rotationVector, to.poses[h].rotationVector),
      pivotMm: mix(pose.pivotMm, to.poses[h].pivotMm),
      translationMm: mix(pose.translationMm, to.poses[h].translationMm),
      scale: pose.scale,
    }));
    const expected = one.evaluate(poses);
    const answer = other.evaluate(poses);
    expect(answer.coverage).toBe(expected.coverage);
    expect(largestOff(answer.positions, Array.from(expected.positions))).toBeLessThanOrEqual(AGREEMENT_MM);
  }
});

test("without WebAssembly it is JavaScript", async () => {
  vi.stubGlobal("WebAssembly", undefined);
  try {
    expect((await makeEvaluator(goldenBytes("linear_elastic"))).kernel.name).toBe("javascript");
  } finally {
    vi.unstubAllGlobals();
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
