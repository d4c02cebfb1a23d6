// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { create } from "@bufbuild/protobuf";
import { expect, test } from "vitest";
import { openCase } from "../../src/case/case_file";
import { PredictionSchema } from "../../src/generated/tissueform/v1/prediction_pb";
import type { Pose } from "../../src/geometry/pose";
import { Plan } from "../../src/planning/plan";
import { Comparer } from "../../src/workbench/comparison";
import { smallCase, sourceOf } from "../testing/small_case";

const AT_REST = new Float32Array(6);
const STORED = AT_REST.map(() => 2);
const BAND = Float32Array.of(0.5, 0.25);

async function comparer(bandOf: Float32Array | null) {
  const plan = new Plan(await openCase(sourceOf(smallCase())));
  const asked: (readonly Pose[])[] = [];
  const made = new Comparer(plan, { ofPrediction: async () => STORED }, async (_, poses) => {
    asked.push(poses);
    return bandOf;
  });
  const planned = { displacements: AT_REST, uncertainty: Float32Array.of(3, 4), poses: plan.poses() };
  return { made, asked, planned };
}

const to = create(PredictionSchema, { name: "predictions/a", poses: [{ handle: "mandible", rotationVector: {}, pivotMm: {}, translationMm: { x: 0, y: -7, z: 0 }, scale: 1 }] });

test("a stored face has the band of its own poses", async () => {
  const { made, asked, planned } = await comparer(BAND);
  const shape = await made.between({ from: "plan", to, share: 1 }, planned);
  expect(shape.uncertainty).toEqual(BAND);
  expect(asked[0].some(({ translationMm }) => translationMm[1] === -7)).toBe(true);
});

test("at the plan's end it is the plan's, at rest and between the ends there is none", async () => {
  const { made, planned } = await comparer(BAND);
  expect((await made.between({ from: "plan", to, share: 0 }, planned)).uncertainty).toEqual(planned.uncertainty);
  expect((await made.between({ from: "rest", to, share: 0 }, planned)).uncertainty).toBeNull();
  const half = await made.between({ from: "rest", to, share: 0.5 }, planned);
  expect([half.uncertainty, half.displacements[0]]).toEqual([null, 1]);
});

test("where no band is known none is shown", async () => {
  const { made, planned } = await comparer(null);
  expect((await made.between({ from: "plan", to, share: 1 }, planned)).uncertainty).toBeNull();
});
