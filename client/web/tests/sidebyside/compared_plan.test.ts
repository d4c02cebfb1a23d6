// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { type CaseFile, openCase } from "../../src/case/case_file";
import type { Pose } from "../../src/geometry/pose";
import { LandmarkBook } from "../../src/measures/landmark_book";
import { Plan } from "../../src/planning/plan";
import { ComparedPlan, type PlanAnswerer } from "../../src/sidebyside/compared_plan";
import type { Shape } from "../../src/workbench/comparison";
import { smallCase, sourceOf } from "../testing/small_case";

beforeEach(() => void vi.useFakeTimers());
afterEach(() => void vi.useRealTimers());

/** The jaw of these poses, in mm forward. */
const forward = ([pose]: readonly Pose[]) => -pose.translationMm[1];

/** All of the skin goes forward as the jaw does. */
function shapeOf(file: CaseFile, poses: Pose[], uncertainty: Float32Array | null = null): Shape {
  return { displacements: Float32Array.from({ length: 3 * file.followed.length }, (_, i) => (i % 3 === 1 ? -forward(poses) : 0)), uncertainty, poses };
}

interface Answering {
  own?: (file: CaseFile, poses: Pose[]) => Promise<Shape | null>;
  solve?: (file: CaseFile, poses: Pose[]) => Promise<{ displacements: Float32Array; summary: null }>;
  model?: string;
}

/** A plan that is looked at, and what was asked for it. */
async function compared({ own = async () => null, solve = async (file, poses) => ({ ...shapeOf(file, poses), summary: null }), model = "linear_elastic" }: Answering = {}) {
  const file = await openCase(sourceOf(smallCase()));
  const asked: string[] = [];
  const bench = {
    file,
    landmarks: new LandmarkBook(file),
    shapeAt: (poses: Pose[]) => (asked.push(`page ${forward(poses)}`), own(file, poses)),
    answers: { solve: (_: string, __: number, poses: Pose[]) => (asked.push(`server ${forward(poses)}`), solve(file, poses)) },
    planAnswers: { skinPointsAt: async () => null },
    penetrationsAt: () => [],
    posesByHandle: (poses: readonly Pose[]) => new Map([["mandible", poses[0]]]),
    modelInfo: () => ({ name: model }),
    live: { session: "sessions/1" },
    model: { value: 0 },
  } as unknown as PlanAnswerer;
  const plan = new Plan(file);
  const result = new ComparedPlan(bench, plan, "A", "Plan", () => {});
  result.setActive(true);
  return { plan, asked, compared: result };
}

const largest = (plan: ComparedPlan) => plan.largest().largestMm;

test("the page's own answer is shown at once, and the server is not asked", async () => {
  const { plan, asked, compared: shown } = await compared({ own: async (file, poses) => shapeOf(file, poses, new Float32Array(file.followed.length).fill(0.5)) });
  plan.change(0, { forwardMm: 3 }, true);
  expect(shown.isAnswered).toBe(false);
  await vi.advanceTimersByTimeAsync(1);
  expect([shown.isAnswered, largest(shown), shown.largest().band]).toEqual([true, 3, { lowestMm: 2.5, highestMm: 3.5 }]);
  await vi.advanceTimersByTimeAsync(1000);
  expect(asked.filter((question) => question.startsWith("server"))).toEqual([]);
  expect(shown.status).toBe("Prepared answer.");
});

test("without an own answer the server is asked once, when the hand rests", async () => {
  const { plan, asked, compared: shown } = await compared();
  await vi.advanceTimersByTimeAsync(1000);
  asked.length = 0;
  for (const mm of [1, 2, 4]) plan.change(0, { forwardMm: mm }, mm === 4);
  await vi.advanceTimersByTimeAsync(100);
  expect(shown.isAnswered).toBe(false);
  await vi.advanceTimersByTimeAsync(1000);
  expect(asked.filter((question) => question.startsWith("server"))).toEqual(["server 4"]);
  expect([shown.isAnswered, largest(shown)]).toEqual([true, 4]);
});

test("an answer to older movements is not shown over newer ones", async () => {
  const answers: (() => void)[] = [];
  const { plan, compared: shown } = await compared({ solve: (file, poses) => new Promise((done) => answers.push(() => done({ ...shapeOf(file, poses), summary: null }))) });
  plan.change(0, { forwardMm: 3 }, true);
  await vi.advanceTimersByTimeAsync(1000);
  plan.change(0, { forwardMm: 7 }, true);
  answers.at(-1)?.();
  await vi.advanceTimersByTimeAsync(100);
  expect(shown.isAnswered).toBe(false);
  await vi.advanceTimersByTimeAsync(1000);
  answers.at(-1)?.();
  await vi.advanceTimersByTimeAsync(1);
  expect(largest(shown)).toBe(7);
});

test("an estimate is shown first, and the full answer replaces it and keeps its band", async () => {
  const { plan, compared: shown } = await compared({
    model: "neo_hookean",
    own: async (file, poses) => shapeOf(file, poses, new Float32Array(file.followed.length).fill(0.25)),
    solve: async (file, poses) => {
      const { displacements } = shapeOf(file, poses);
      return { displacements: displacements.map((value) => 1.5 * value), summary: null };
    },
  });
  plan.change(0, { forwardMm: 2 }, true);
  await vi.advanceTimersByTimeAsync(1);
  expect([largest(shown), shown.status]).toEqual([2, "Estimate; the full answer follows."]);
  await vi.advanceTimersByTimeAsync(1000);
  expect([largest(shown), shown.uncertainty?.[0]]).toEqual([3, 0.25]);
});

test("what the server refuses is stated, and no number is shown", async () => {
  const { compared: shown, plan } = await compared({ solve: () => Promise.reject(new Error("the server is draining")) });
  plan.change(0, { forwardMm: 2 }, true);
  await vi.advanceTimersByTimeAsync(1000);
  expect(shown.isAnswered).toBe(false);
  expect(shown.status).toMatch(/^Not answered: .*draining/);
});

test("a hidden plan asks nothing, and the newest movements once it is shown", async () => {
  const { plan, asked, compared: shown } = await compared();
  await vi.advanceTimersByTimeAsync(1000);
  shown.setActive(false);
  asked.length = 0;
  plan.change(0, { forwardMm: 5 }, true);
  await vi.advanceTimersByTimeAsync(1000);
  expect(asked).toEqual([]);
  shown.setActive(true);
  await vi.advanceTimersByTimeAsync(1000);
  expect(asked).toEqual(["page 5", "server 5"]);
  expect(largest(shown)).toBe(5);
});
