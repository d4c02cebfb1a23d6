// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { expect, test } from "vitest";
import type { Pose } from "../../src/geometry/pose";
import { landmarkMovements } from "../../src/measures/face_measures";
import { movementBands } from "../../src/measures/movement_bands";
import { PUBLISHED } from "../../src/measures/deviations";
import { type PlanAnswers, wholeBands } from "../../src/measures/whole_band";
import { faceThatFollows } from "../testing/following_face";

const Z95 = 1.96;

test("bone is missed by what surgery misses, and has neither model nor material in doubt", async () => {
  const { shown, answers, plan } = await faceThatFollows(0.7, 2);
  plan.change(0, { forwardMm: 4, yawDeg: 0 }, true);
  const bone = shown.file.manifest.landmarks.findIndex(({ handle }) => handle === "mandible");
  const band = (await movementBands(shown, answers))?.[bone];
  // Without the turn's part it is the deviation along that axis; the turn can only widen it.
  expect(band?.forwardMm.parts.surgery).toBeGreaterThanOrEqual(Z95 * PUBLISHED.all.translationMm[1] - 1e-3);
  expect(band?.leftMm.parts.surgery).toBeGreaterThanOrEqual(Z95 * PUBLISHED.all.translationMm[0] - 1e-3);
  expect(band?.forwardMm.parts).toMatchObject({ model: 0, material: null });
});

test("a number's band is around it, and a total is at least 0", async () => {
  const { shown, answers } = await faceThatFollows(0.7, 2);
  const movements = landmarkMovements(shown);
  const bands = await movementBands(shown, answers);
  expect(bands).toHaveLength(movements.length);
  bands?.forEach((band, index) => {
    if (band === null) return expect(movements[index].totalMm).toBeLessThan(0.05);
    for (const way of ["forwardMm", "leftMm", "upMm"] as const) expect((band[way].lowest + band[way].highest) / 2).toBeCloseTo(movements[index][way], 4);
    expect(band.totalMm.lowest).toBeGreaterThanOrEqual(0);
    expect(band.totalMm.highest).toBeGreaterThan(movements[index].totalMm);
  });
});

test("the skin's parts add as independent ones, and the model's is along the normal", async () => {
  const [without, withBand] = [await faceThatFollows(0.7, null), await faceThatFollows(0.7, 2)];
  const index = without.shown.file.manifest.landmarks.findIndex(({ handle, skinVertex }) => handle === "" && skinVertex !== null);
  const [none, some] = await Promise.all([without, withBand].map(async ({ shown, answers }) => (await movementBands(shown, answers))![index]!));
  const half = ({ lowest, highest }: { lowest: number; highest: number }) => (highest - lowest) / 2;
  expect(half(some.forwardMm)).toBeCloseTo(Math.hypot(half(none.forwardMm), 2), 4);
  const model = Math.hypot(...(["forwardMm", "leftMm", "upMm"] as const).map((way) => none[way].parts.model));
  expect(model).toBeCloseTo(Z95 * (PUBLISHED.all.modelMm.get("default") ?? NaN), 3);
});

test("skin that follows its bone by a share is missed by that share", async () => {
  const { shown, answers } = await faceThatFollows(0.5, null);
  const whole = await faceThatFollows(1, null);
  const index = shown.file.manifest.landmarks.findIndex(({ handle, skinVertex }) => handle === "" && skinVertex !== null);
  const [half, all] = [(await movementBands(shown, answers))![index]!, (await movementBands(whole.shown, whole.answers))![index]!];
  for (const way of ["forwardMm", "leftMm", "upMm"] as const) expect(half[way].parts.surgery).toBeCloseTo(all[way].parts.surgery / 2, 2);
});

test("what neither the plan nor its deviations move has no band", async () => {
  const { shown, answers } = await faceThatFollows(0, 2);
  const { landmarks } = shown.file.manifest;
  const bands = await movementBands(shown, answers);
  expect(bands?.map((band) => band !== null)).toEqual(landmarks.map(({ handle }) => handle === "mandible"));
});

test("a segment that the plan leaves in place is not missed", async () => {
  const { shown, answers } = await faceThatFollows(0.7, null);
  let asked = 0;
  const resting = { rotationVector: [0, 0, 0], pivotMm: [5, 5, 5], translationMm: [0, 0, 0], scale: 1 } satisfies Pose;
  const both: PlanAnswers = {
    handles: [...answers.handles, { name: "maxilla" }],
    poses: () => [...answers.poses(), resting],
    skinPointsAt: async (poseSets, anchors) => {
      asked += poseSets.length;
      poseSets.forEach((poses) => expect(poses[1]).toEqual(resting));
      return answers.skinPointsAt(poseSets.map((poses) => poses.slice(0, 1)), anchors);
    },
  };
  expect(await movementBands(shown, both)).toEqual(await movementBands(shown, answers));
  expect(asked).toBe(7);
});

test("a plan that moves nothing has no band, and none is known where the page cannot answer", async () => {
  const { shown, answers, plan } = await faceThatFollows(0.7, null);
  expect(await movementBands(shown, { ...answers, skinPointsAt: async () => null })).toBeNull();
  plan.change(0, { forwardMm: 0, yawDeg: 0 }, true);
  expect(await movementBands(shown, answers)).toBeNull();
  expect(await wholeBands(shown, answers)).toBeNull();
});
