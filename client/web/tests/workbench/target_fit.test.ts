// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { create } from "@bufbuild/protobuf";
import { expect, test, vi } from "vitest";
import { openCase } from "../../src/case/case_file";
import { type FitResponse, FitResponseSchema } from "../../src/generated/tissueform/v1/plan_service_pb";
import { Plan } from "../../src/planning/plan";
import { type FitAsk, type Target, TargetFit } from "../../src/workbench/target_fit";
import { placeOfAnchor, placeOfRegion, shownMove } from "../../src/workbench/target_place";
import { smallCase, sourceOf } from "../testing/small_case";

/** Answers wait until the test gives them. */
async function bench() {
  const file = await openCase(sourceOf(smallCase()));
  const plan = new Plan(file);
  const asked: FitAsk[] = [];
  const answers: ((forwardMm: number | Error) => Promise<void>)[] = [];
  const overtaken = vi.fn();
  const ask = (request: FitAsk): Promise<FitResponse> => {
    asked.push(request);
    return new Promise((resolve, reject) => {
      answers.push(async (forwardMm) => {
        if (forwardMm instanceof Error) reject(forwardMm);
        else resolve(create(FitResponseSchema, { poses: [{ handle: "mandible", rotationVector: {}, pivotMm: { x: 5, y: 5, z: 0 }, translationMm: { x: 0, y: -forwardMm, z: 0 }, scale: 1 }] }));
        await new Promise((done) => setTimeout(done, 0));
      });
    });
  };
  const fit = new TargetFit(file, plan, ask, overtaken);
  const place = placeOfAnchor(file, { surface: 0, triangle: 0, weights: [1, 0, 0] }) ?? expect.fail("no place");
  const target = (forwardMm: number): Target => ({ label: "Chin", place, move: { forwardMm, leftMm: 0, upMm: 0 }, isAlong: false, isChanged: true });
  /** One that was just chosen on a face that lies so far forward. */
  const chosen = (forwardMm: number): Target => ({ ...target(forwardMm), isChanged: false });
  return { file, plan, fit, asked, answers, target, chosen, overtaken };
}

test("one call is on its way at a time, and the newest target alone is asked next", async () => {
  const { fit, asked, answers, target } = await bench();
  for (const mm of [1, 2, 3]) fit.set([target(mm)]);
  expect(asked.length).toBe(1);
  await answers[0](1);
  expect(asked.length).toBe(2);
  expect(asked[1].targets?.[0].wanted).toEqual({ case: "displacementMm", value: { x: 0, y: -3, z: 0 } });
  await answers[1](3);
  expect([asked.length, fit.isAsking.value]).toEqual([2, false]);
});

test("what is found is shown at once, and accepting makes one step of it all", async () => {
  const { plan, fit, answers, target } = await bench();
  fit.set([target(1)]);
  await answers[0](1);
  fit.set([target(2)]);
  await answers[1](2);
  expect(plan.moves[0].forwardMm).toBeCloseTo(2);
  fit.accept();
  expect(fit.isActive).toBe(false);
  expect(plan.moves[0].forwardMm).toBeCloseTo(2);
  plan.undo();
  expect([plan.moves[0].forwardMm, plan.canUndo]).toEqual([0, false]);
});

test("what was found for older targets is not to be accepted for the newest", async () => {
  const { fit, answers, target } = await bench();
  const seen: boolean[] = [];
  fit.isAsking.watch(() => seen.push(fit.isSettled));
  fit.set([target(1)]);
  fit.set([target(2)]);
  await answers[0](1);
  expect(fit.isSettled).toBe(false);
  await answers[1](2);
  expect(fit.isSettled).toBe(true);
  fit.set([target(9)]);
  expect(fit.isSettled).toBe(false);
  await answers[2](new Error("away"));
  expect(fit.isSettled).toBe(false);
  expect(seen).toEqual([false, false, true, false, false]);
});

test("rejecting brings the plan back, and an answer that comes later changes nothing", async () => {
  const { plan, fit, answers, target } = await bench();
  plan.change(0, { upMm: 1 }, true);
  fit.set([target(1)]);
  await answers[0](1);
  fit.set([target(4)]);
  fit.reject();
  await answers[1](4);
  expect(plan.moves[0]).toMatchObject({ forwardMm: 0, upMm: 1 });
  expect(fit.fitted.value).toBeNull();
});

test("a target that was just chosen asks nothing, goes with the face, and leaves the plan as it is", async () => {
  const { plan, fit, asked, answers, target, chosen } = await bench();
  plan.change(0, { forwardMm: 6 }, true);
  const before = plan.moves;
  fit.set([chosen(5)]);
  await fit.update();
  expect([asked.length, plan.moves, fit.isAsked, fit.isSettled]).toEqual([0, before, false, false]);
  plan.change(0, { forwardMm: 7 }, true);
  fit.follow(() => ({ forwardMm: 5.5, leftMm: 0, upMm: 0.5 }));
  expect(fit.targets.value[0].move).toEqual({ forwardMm: 5.5, leftMm: 0, upMm: 0.5 });
  fit.set([target(8)]);
  fit.follow(() => expect.fail("what was asked for goes with nothing"));
  // The search begins with the plan as it was when something was asked, not when the place was chosen.
  expect(asked[0].poses?.[0].translationMm?.y).toBeCloseTo(-7);
  await answers[0](7);
  const asks = asked.length;
  fit.set([...fit.targets.value, chosen(2)]);
  expect([asked.length, fit.isSettled]).toEqual([asks, true]);
});

test("without the target that was changed the plan is as it was", async () => {
  const { plan, fit, answers, target, chosen } = await bench();
  fit.set([chosen(1), target(4)]);
  await answers[0](4);
  expect(plan.moves[0].forwardMm).toBeCloseTo(4);
  fit.set(fit.targets.value.slice(0, 1));
  expect([plan.moves[0].forwardMm, fit.isActive, fit.isSettled]).toEqual([0, true, false]);
});

test("what is changed by hand meanwhile is a step of the plan without the preview, and ends the targets", async () => {
  const { plan, fit, asked, answers, target, overtaken } = await bench();
  plan.change(0, { upMm: 1 }, true);
  fit.set([target(3)]);
  await answers[0](3);
  fit.set([target(4)]);
  plan.change(0, { leftMm: 2 }, true);
  expect([fit.isActive, overtaken.mock.calls.length]).toEqual([false, 1]);
  await answers[1](4);
  fit.reject();
  fit.accept();
  expect(plan.moves[0]).toMatchObject({ forwardMm: 0, leftMm: 2, upMm: 1 });
  plan.undo();
  expect(plan.moves[0]).toMatchObject({ forwardMm: 0, leftMm: 0, upMm: 1 });
  expect(asked.length).toBe(2);
});

test("undo during a target takes back the preview alone, and nothing accepts it afterwards", async () => {
  const { plan, fit, answers, target, overtaken } = await bench();
  plan.change(0, { upMm: 1 }, true);
  fit.set([target(3)]);
  await answers[0](3);
  expect(plan.canUndo).toBe(true);
  plan.undo();
  expect([plan.moves[0].forwardMm, plan.moves[0].upMm, fit.isActive, overtaken.mock.calls.length]).toEqual([0, 1, false, 1]);
  fit.accept();
  expect(plan.moves[0].forwardMm).toBe(0);
  plan.undo();
  expect([plan.moves[0].upMm, plan.canUndo]).toEqual([0, false]);
});

test("an answer to targets that have ended is none to those that came after them", async () => {
  const { plan, fit, answers, target } = await bench();
  fit.set([target(3)]);
  plan.change(0, { upMm: 1 }, true);
  fit.set([target(5)]);
  await answers[0](3);
  expect([plan.moves[0].forwardMm, fit.isSettled]).toEqual([0, false]);
  await answers[1](5);
  expect([plan.moves[0].forwardMm, plan.moves[0].upMm, fit.isSettled]).toEqual([expect.closeTo(5), 0, true]);
});

test("the search goes on from what was found, within the limits, by those that may move", async () => {
  const { fit, asked, answers, target } = await bench();
  fit.set([target(1)]);
  expect(asked[0].poses?.[0].translationMm).toMatchObject({ y: 0 });
  expect(asked[0].freedoms?.[0].translationMm?.x).toEqual({ lowest: -15, highest: 15 });
  await answers[0](1);
  fit.free.clear();
  void fit.update();
  expect(asked[1]).toMatchObject({ freedoms: [], poses: [{ translationMm: { y: 0 } }] });
  await answers[1](0);
  fit.free.add("mandible");
  fit.set([{ ...target(2), isAlong: true }]);
  expect(asked[2].targets?.[0].wanted).toEqual({ case: "movement", value: { direction: { x: 0, y: -2, z: 0 }, byMm: 2 } });
});

test("in a head that lies aslant the search stays within its limits, and how far it goes is known", async () => {
  const { file, plan, target } = await bench();
  const half = Math.SQRT1_2;
  const turned = { ...file, manifest: { ...file.manifest, headFrame: { ...file.manifest.headFrame, left: [half, half, 0] as const, posterior: [-half, half, 0] as const } } } as unknown as typeof file;
  const asked: FitAsk[] = [];
  const fit = new TargetFit(turned, plan, async (request) => {
    asked.push(request);
    return create(FitResponseSchema, {});
  });
  expect(fit.limitShare).toBeCloseTo(half);
  fit.set([target(1)]);
  expect(asked[0].freedoms?.[0].translationMm?.x?.highest).toBeCloseTo(15 * half);
  expect(asked[0].freedoms?.[0].rotationVector?.z?.highest).toBeCloseTo((20 * half * Math.PI) / 180);
});

test("a refusal is kept for who reads it, and the next target is asked all the same", async () => {
  const { fit, asked, answers, target } = await bench();
  fit.set([target(1)]);
  await answers[0](new Error("the point lies off the skin"));
  expect(fit.problem.value).toMatchObject({ message: "the point lies off the skin" });
  fit.set([target(2)]);
  await answers[1](2);
  expect([asked.length, fit.problem.value]).toEqual([2, null]);
});

test("a place is where the drawn skin follows the mesh, and none where it does not", async () => {
  const { file } = await bench();
  expect(placeOfAnchor(file, { surface: 0, triangle: 0, weights: [0.2, 0.6, 0.2] })).toMatchObject({ pointMm: [5, 5, 0], share: 1, drawnMm: [10, 0, 0] });
  expect(placeOfAnchor(file, { surface: 0, triangle: 1, weights: [0, 1, 0] })).toBeNull();
  expect(placeOfAnchor(file, { surface: 1, triangle: 0, weights: [1, 0, 0] })).toBeNull();
  expect(placeOfRegion(file, 1)).toBeNull();
  const regions = { ...file, surfaces: file.surfaces.map((surface) => ({ ...surface, regions: Uint8Array.from([1, 1, 0, 0]) })) };
  const region = placeOfRegion(regions, 1) ?? expect.fail("no place");
  expect(region.vertices?.length).toBe(2);
  // Vertex 0 follows the first of the list, vertex 1 the half of the second and the third.
  const displacements = new Float32Array(3 * file.followed.length);
  displacements.set([0, -4, 0, 0, -2, 0]);
  expect(shownMove(region, displacements)).toEqual([0, -3, 0]);
  const point = placeOfAnchor(file, { surface: 0, triangle: 0, weights: [0.2, 0.6, 0.2] }) ?? expect.fail("no place");
  expect(shownMove(point, displacements)).toEqual([0, -1, 0]);
});
