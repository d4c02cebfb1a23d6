// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { expect, test } from "vitest";
import type { Pose } from "../../src/geometry/pose";
import { GOLDEN, goldenCases, openGolden } from "./golden_answers";

const AGREEMENT_MM = 1e-4;
const BAND_AGREEMENT_MM = 2e-3;

const largestOff = (positions: Float32Array, expected: number[]) => expected.reduce((most, value, i) => Math.max(most, Math.abs(value - positions[i])), 0);

test.each(GOLDEN)("%s gives the positions, errors and bands that are written there", async (name) => {
  const evaluator = await openGolden(name);
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

test.each(GOLDEN)("%s gives chosen vertices the same places, to the bit, in any order", async (name) => {
  const evaluator = await openGolden(name);
  const cases = goldenCases(name);
  const covered = cases.filter(({ isCovered }) => isCovered).map(({ poses }) => poses);
  const all = covered.map((poses) => evaluator.evaluate(poses).positions.slice());
  const count = all[0].length / 3;
  for (const vertices of [Int32Array.of(count - 1, 0, Math.floor(count / 2)), Int32Array.from({ length: count }, (_, v) => v), Int32Array.of()]) {
    const expected = all.flatMap((positions) => Array.from(vertices).flatMap((v) => Array.from(positions.subarray(3 * v, 3 * v + 3))));
    expect(Array.from(evaluator.placesAt(covered, vertices) ?? [NaN])).toEqual(expected);
  }
  const beyond = cases.find(({ isCovered }) => !isCovered);
  if (beyond !== undefined) expect(evaluator.placesAt([covered[0], beyond.poses], Int32Array.of(0))).toBeNull();
  expect(evaluator.placesAt([[]], Int32Array.of(0))).toBeNull();
});

test("a handle that turns beyond the range has positions and no band", async () => {
  const evaluator = await openGolden("linear_elastic_band");
  const cases = goldenCases("linear_elastic_band");
  expect(Math.hypot(...cases[7].poses[0].rotationVector)).toBeCloseTo(0.42);
  expect(evaluator.evaluate(cases[7].poses)).toMatchObject({ coverage: "covered", uncertainty: null });
  expect(evaluator.valuesAt(cases[7].poses, "band")).toBeNull();
  expect(evaluator.valuesAt(cases[1].poses, "band")?.length).toBe(cases[1].bandMm?.length);
});

test("poses that are none are beyond what is covered, and leave the positions as they were", async () => {
  const evaluator = await openGolden("linear_elastic");
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
