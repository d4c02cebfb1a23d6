// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { expect, test } from "vitest";
import { openCase } from "../../src/case/case_file";
import { NO_MOVE, movedPoint } from "../../src/geometry/pose";
import { formatNumber, formatWithUnit, parseNumber } from "../../src/planning/numbers";
import { describeMovement, landmarkMovement } from "../../src/planning/landmarks";
import { pivotChoices, pivotText } from "../../src/planning/pivots";
import { Plan, posesOfCase } from "../../src/planning/plan";
import { smallCase, sourceOf } from "../testing/small_case";

const makePlan = async () => {
  const file = await openCase(sourceOf(smallCase()));
  return { file, plan: new Plan(file) };
};

test("undo takes back whole movements, redo brings them back, and a new one ends the redo", async () => {
  const { plan } = await makePlan();
  for (const value of [1, 2, 3]) plan.change(0, { forwardMm: value }, false);
  plan.change(0, { forwardMm: 4 }, true);
  plan.change(0, { upMm: 2 }, true);
  plan.undo();
  expect(plan.moves[0]).toEqual({ ...NO_MOVE, forwardMm: 4 });
  plan.undo();
  expect(plan.isAtRest).toBe(true);
  expect(plan.canUndo).toBe(false);
  plan.undo();
  plan.redo();
  expect(plan.moves[0].forwardMm).toBe(4);
  plan.change(0, { leftMm: 1 }, true);
  expect(plan.canRedo).toBe(false);
});

test("undo has no end", async () => {
  const { plan } = await makePlan();
  for (let i = 1; i <= 1500; ++i) plan.change(0, { forwardMm: (i % 100) / 10 }, true);
  let count = 0;
  while (plan.canUndo) {
    plan.undo();
    ++count;
  }
  expect(count).toBe(1500);
  expect(plan.isAtRest).toBe(true);
});

test("a change that changes nothing is nothing to undo", async () => {
  const { plan } = await makePlan();
  plan.change(0, { forwardMm: 0 }, true);
  expect(plan.canUndo).toBe(false);
});

test("limits hold both ways and are reported", async () => {
  const { plan } = await makePlan();
  expect(plan.change(0, { forwardMm: 15 }, true)).toBe(true);
  expect(plan.change(0, { forwardMm: 16, yawDeg: -25 }, true)).toBe(false);
  expect(plan.moves[0]).toMatchObject({ forwardMm: 15, yawDeg: -20 });
});

test("another pivot leaves the segment where it is", async () => {
  const { plan } = await makePlan();
  plan.change(0, { forwardMm: 3, pitchDeg: 10, yawDeg: 5 }, true);
  const before = movedPoint(plan.poses()[0], [2, 3, 4]);
  plan.setPivot(0, [1, -9, 4]);
  movedPoint(plan.poses()[0], [2, 3, 4]).forEach((part, k) => expect(part).toBeCloseTo(before[k], 9));
  plan.undo();
  expect(plan.pivot(0)).toEqual([5, 5, 0]);
});

test("a known pivot is described by name and place, an unknown one by its place", async () => {
  const { file, plan } = await makePlan();
  const choices = pivotChoices(plan.handles[0], file.manifest.landmarks, [1, 2.25, -3]);
  expect(choices.map(({ label }) => label)).toEqual(["The case’s pivot", "Middle of the segment", "Pogonion"]);
  plan.setPivot(0, choices[1].value);
  expect(pivotText(choices, plan.pivot(0))).toBe("Middle of the segment (1.0, 2.3, −3.0)");
  expect(pivotText(choices, [1, 2.25, -3.5])).toBe("(1.0, 2.3, −3.5)");
});

test("the case's own pose is 8 mm forward", async () => {
  const { file, plan } = await makePlan();
  plan.setPoses(posesOfCase(file));
  expect(plan.moves[0].forwardMm).toBeCloseTo(8, 12);
  plan.reset();
  expect(plan.isAtRest).toBe(true);
});

test("landmarks move with their segment, with the skin, or not at all", async () => {
  const { file, plan } = await makePlan();
  plan.change(0, { forwardMm: 8, upMm: -1 }, true);
  const poses = new Map([["mandible", plan.poses()[0]]]);
  const [pogonion, soft] = file.manifest.landmarks;
  const movement = landmarkMovement(pogonion, poses, () => [0, 0, 0], file.manifest.headFrame);
  expect(movement.forwardMm).toBeCloseTo(8, 12);
  expect(describeMovement(movement)).toBe("8.0 mm forward, 1.0 mm down");
  expect(landmarkMovement(soft, poses, () => [0, -5, 0], file.manifest.headFrame).forwardMm).toBeCloseTo(5, 12);
  expect(describeMovement(landmarkMovement(soft, poses, () => [0, 0, 0], file.manifest.headFrame))).toBe("at rest");
  expect(landmarkMovement({ ...pogonion, skinVertex: 0 }, poses, () => [0, 0, 9], file.manifest.headFrame)).toEqual(movement);
});

test.each<[string, "mm" | "°", number | null]>([
  ["8", "mm", 8],
  [" -1.5 mm ", "mm", -1.5],
  ["+2,25", "mm", 2.25],
  ["−3", "mm", -3],
  [".5", "mm", 0.5],
  ["3°", "°", 3],
  ["3 deg", "°", 3],
  ["3 °", "mm", null],
  ["", "mm", null],
  ["1e3", "mm", null],
  ["eight", "mm", null],
  ["1.2.3", "mm", null],
  ["--1", "mm", null],
])("“%s” in %s is %s", (text, unit, value) => {
  expect(parseNumber(text, unit)).toBe(value);
});

test("numbers are written with a minus and never as minus nothing", () => {
  expect(formatNumber(-0.04)).toBe("0.0");
  expect(formatWithUnit(-2.25, "mm")).toBe("−2.3 mm");
  expect(formatWithUnit(4, "°")).toBe("4.0°");
  expect(parseNumber(formatNumber(-2.5), "mm")).toBe(-2.5);
});
