// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { create } from "@bufbuild/protobuf";
import { expect, test } from "vitest";
import { type CaseFile, openCase } from "../../src/case/case_file";
import { PredictionSchema } from "../../src/generated/tissueform/v1/prediction_pb";
import { LandmarkBook } from "../../src/measures/landmark_book";
import type { Pose } from "../../src/geometry/pose";
import { Plan } from "../../src/planning/plan";
import { Comparer } from "../../src/workbench/comparison";
import { storedMeasures } from "../../src/workbench/stored_measures";
import { skinPointsOf } from "../testing/following_face";
import { smallCase, sourceOf } from "../testing/small_case";

const STORED_MM = 2;
const BAND_MM = 0.25;

/** A prediction whose skin is 2 mm to the left and whose jaw 3 mm, and whose band the page answers when the test calls `answer`. */
async function asked(canAnswer = false) {
  const file = await openCase(sourceOf(smallCase()));
  const landmarks = new LandmarkBook(file);
  landmarks.place("soft_pogonion", { surface: 0, triangle: 0, weights: [1, 0, 0] });
  landmarks.place("lower_midline", { surface: 1, triangle: 0, weights: [1, 0, 0] });
  const count = file.followed.length;
  const stored = Float32Array.from({ length: 3 * count }, (_, i) => (i % 3 === 0 ? STORED_MM : 0));
  let answer: (band: Float32Array | null) => void = () => {};
  const plan = new Plan(file);
  const comparer = new Comparer(plan, { ofPrediction: async () => stored }, () => new Promise((done) => (answer = done)));
  const planned = { displacements: new Float32Array(3 * count), uncertainty: null as Float32Array | null, poses: plan.poses() };
  const prediction = create(PredictionSchema, { poses: [{ handle: "mandible", rotationVector: {}, pivotMm: {}, translationMm: { x: 3, y: 0, z: 0 }, scale: 1 }] });
  const answers = { handles: plan.handles, poses: () => plan.poses(), skinPointsAt: canAnswer ? skinPointsOf(file, skinAfterJaw(file)) : async () => null };
  const measures = storedMeasures({ file, landmarks, comparer, planned, answers }, prediction);
  await new Promise((done) => setTimeout(done, 0));
  return { file, plan, planned, measures, answer: (isKnown: boolean) => answer(isKnown ? new Float32Array(count).fill(BAND_MM) : null) };
}

/** Skin that goes along with the jaw, whole. */
function skinAfterJaw(file: CaseFile) {
  return ([pose]: readonly Pose[]) => (surface: number) => file.surfaces[surface].positions.map((value, i) => value + pose.translationMm[i % 3]);
}

test("where the page can answer, the interval holds surgery and model, too, and says so", async () => {
  const { measures, answer } = await asked(true);
  answer(true);
  const chin = (await measures).find(({ name }) => name === "chin_midline");
  // The skin follows the jaw, which has no front but its turns' place: at least surgery's 0.82 mm left-right.
  expect(chin).toMatchObject({ after: STORED_MM, intervalIsWhole: true });
  expect((chin?.highestAfter ?? 0) - STORED_MM).toBeGreaterThan(1.96 * Math.hypot(0.82, BAND_MM / 1.96) - 1e-6);
});

test("they are of the stored face, with its band, whatever the plan shows meanwhile", async () => {
  const { file, plan, planned, measures, answer } = await asked();
  const before = file.surfaces[0].positions.slice();
  // The user goes on planning before the band is there.
  plan.change(0, { leftMm: 9 }, true);
  planned.displacements.fill(9);
  planned.uncertainty = new Float32Array(file.followed.length).fill(9);
  answer(true);
  const found = Object.fromEntries((await measures).map((measure) => [measure.name, measure]));
  expect(found.chin_midline).toMatchObject({ before: 0, after: STORED_MM, lowestAfter: expect.closeTo(STORED_MM - BAND_MM), highestAfter: expect.closeTo(STORED_MM + BAND_MM), intervalIsWhole: false });
  expect(found.lower_midline).toMatchObject({ before: 0, after: 3 });
  expect(file.surfaces[0].positions).toEqual(before);
});

test("where no band is known there is none", async () => {
  const { measures, answer } = await asked();
  answer(false);
  const chin = (await measures).find(({ name }) => name === "chin_midline");
  expect([chin?.after, chin?.lowestAfter]).toEqual([STORED_MM, undefined]);
});
