// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { create } from "@bufbuild/protobuf";
import { expect, test } from "vitest";
import { openCase } from "../../src/case/case_file";
import { PredictionSchema } from "../../src/generated/tissueform/v1/prediction_pb";
import type { Pose } from "../../src/geometry/pose";
import { LandmarkBook } from "../../src/measures/landmark_book";
import { Plan } from "../../src/planning/plan";
import type { ComparedPlan } from "../../src/sidebyside/compared_plan";
import { MOST_PLANS, PlanSet } from "../../src/sidebyside/plan_set";
import { Signal } from "../../src/workbench/signal";
import type { Workbench } from "../../src/workbench/workbench";
import { smallCase, sourceOf } from "../testing/small_case";

/** A jaw 3 mm to the left. */
const STORED = create(PredictionSchema, { name: "predictions/1", title: "Left", poses: [{ handle: "mandible", rotationVector: {}, pivotMm: {}, translationMm: { x: 3, y: 0, z: 0 }, scale: 1 }] });

/** Skin goes as the jaw does; the connection is there from the start, or fails until a test says so. */
async function opened(stored = [STORED], isThere = true) {
  const file = await openCase(sourceOf(smallCase()));
  const answers = { isThere };
  const shapeAt = async (poses: Pose[]) => {
    if (!answers.isThere) return null;
    const [x, y, z] = poses[0].translationMm;
    return { displacements: Float32Array.from({ length: 3 * file.followed.length }, (_, i) => [x, y, z][i % 3]), uncertainty: null, poses };
  };
  const bench = {
    file,
    plan: new Plan(file),
    landmarks: new LandmarkBook(file),
    stored: { all: new Signal(stored) },
    localState: new Signal({ kind: "ready" }),
    connection: new Signal({ kind: "live" }),
    shapeAt,
    planAnswers: { skinPointsAt: async () => null },
    penetrationsAt: () => [],
    posesByHandle: (poses: readonly Pose[]) => new Map([["mandible", poses[0]]]),
    modelInfo: () => ({ name: "linear_elastic" }),
    answers: { solve: () => Promise.reject(new Error("the server is away")) },
    live: { session: "sessions/1" },
    model: { value: 0 },
  };
  const set = new PlanSet(bench as unknown as Workbench, () => {});
  set.open(true);
  await settled(set);
  return { bench, set, answers };
}

const settled = (set: PlanSet) => expect.poll(() => set.plans.value.every(({ isAnswered, hasFailed }) => isAnswered || hasFailed)).toBe(true);
const leftMm = ({ plan }: ComparedPlan) => plan.moves[0].leftMm;
const source = (set: PlanSet, label: string) => set.sources().find((other) => other.label === label) ?? expect.fail(label);

test("it begins with the planner's plan and the newest prediction, or else a copy", async () => {
  const { set, bench } = await opened();
  expect(set.plans.value.map(({ label }) => label)).toEqual(["A: Planner’s plan", "B: Left"]);
  expect(set.own.plan).toBe(bench.plan);
  expect(leftMm(set.plans.value[1])).toBeCloseTo(3, 9);
  expect((await opened([])).set.plans.value.map(({ label }) => label)).toEqual(["A: Planner’s plan", "B: Copy of A"]);
});

test("a copy has the movements of its source as they are when it is added, and an undo of its own", async () => {
  const { set } = await opened();
  const copy = source(set, "Copy of A: Planner’s plan");
  set.own.plan.change(0, { upMm: 2 }, true);
  set.add(copy);
  const added = set.active.value;
  expect([added.letter, added.plan.moves[0].upMm, added.plan.canUndo]).toEqual(["C", 2, false]);
  added.plan.change(0, { upMm: 5 }, true);
  added.plan.undo();
  expect([added.plan.moves[0].upMm, set.own.plan.moves[0].upMm]).toEqual([2, 2]);
  set.own.plan.undo();
  expect([added.plan.moves[0].upMm, set.own.plan.moves[0].upMm]).toEqual([2, 0]);
});

test("a removed plan leaves its letter, is not edited any more and nothing differs from it", async () => {
  const { set } = await opened();
  set.add(source(set, "Pre-op"));
  set.add(source(set, "The case’s plan"));
  expect(set.plans.value.length).toBe(MOST_PLANS);
  const [, b, c, d] = set.plans.value;
  expect([leftMm(c), d.plan.moves[0].forwardMm]).toEqual([0, expect.closeTo(8, 9)]);
  set.active.value = set.reference.value = b;
  set.remove(b);
  expect([set.active.value.letter, set.reference.value]).toEqual(["A", null]);
  set.add(source(set, "Pre-op"));
  expect(set.plans.value.map(({ letter }) => letter)).toEqual(["A", "C", "D", "B"]);
});

test("all faces have the colors of one scale, that of the largest number", async () => {
  const { set } = await opened();
  set.own.plan.change(0, { leftMm: 1.5 }, true);
  await settled(set);
  set.map.value = "movement";
  set.color();
  expect(set.legend.value).toEqual({ title: "Movement of the skin", ticksMm: [0, 1.5, 3], note: "largest: A 1.50, B 3.00 mm" });
  const colorOf = (plan: ComparedPlan) => Array.from((plan.head.skins[0].mesh.geometry.attributes.color.array as Float32Array).slice(0, 3));
  const [atHalf, atMost] = set.plans.value.map(colorOf);
  // Half of the scale of viridis is #21918c, its end #fde725, in linear light.
  expect(atHalf.map((value) => Math.round(100 * value))).toEqual([2, 28, 26]);
  expect(atMost.map((value) => Math.round(100 * value))).toEqual([98, 80, 2]);
  set.reference.value = set.plans.value[1];
  set.map.value = "difference";
  set.color();
  expect(set.legend.value).toMatchObject({ title: "Difference to B", note: "largest: A 1.50, B 0.00 mm" });
  set.map.value = "none";
  set.color();
  expect(set.legend.value).toBeNull();
});

test("a plan that is taken is one step of the planner's plan", async () => {
  const { set, bench } = await opened();
  bench.plan.change(0, { upMm: 1 }, true);
  set.take(set.plans.value[1]);
  expect(bench.plan.moves[0]).toMatchObject({ leftMm: expect.closeTo(3, 9), upMm: expect.closeTo(0, 9) });
  bench.plan.undo();
  expect(bench.plan.moves[0]).toMatchObject({ leftMm: 0, upMm: 1 });
});

test("plans without an answer are asked again when the server is back", async () => {
  const { set, bench, answers } = await opened([], false);
  expect(set.own.status).toBe("Not answered: The server is away.");
  answers.isThere = true;
  bench.connection.value = { kind: "live" };
  await expect.poll(() => set.plans.value.map(({ isAnswered }) => isAnswered)).toEqual([true, true]);
});
