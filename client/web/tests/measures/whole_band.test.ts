// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { readFileSync } from "node:fs";
import { expect, test } from "vitest";
import { movedPoint } from "../../src/geometry/pose";
import { pointAt } from "../../src/geometry/rigid_fit";
import { type Vector, add, apply, cross, fromRotationVector, norm, scaled, subtract } from "../../src/geometry/rotation";
import { anchorPoint, corners } from "../../src/measures/anchor";
import { PUBLISHED, modelDeviation } from "../../src/measures/deviations";
import { wholeBands } from "../../src/measures/whole_band";
import { faceThatFollows } from "../testing/following_face";

const ROOT = new URL("../../../../", import.meta.url);
const numbers = (text: string | undefined) => (text ?? "").split(",").map(Number);

test("the deviations are those of the command", () => {
  const surgery = readFileSync(new URL("core/mechanics/uncertainty/surgery_expansion.h", ROOT), "utf8");
  const model = readFileSync(new URL("core/planning/outcome/deviations.h", ROOT), "utf8");
  const forward = readFileSync(new URL("core/planning/outcome/deviations.cc", ROOT), "utf8");
  const { translationMm, rotationDeg, modelMm } = PUBLISHED.all;
  expect(numbers(/translation_mm = \{([^}]*)\}/.exec(surgery)?.[1])).toEqual(translationMm);
  expect(numbers(/rotation_deg = \{([^}]*)\}/.exec(surgery)?.[1])).toEqual(rotationDeg);
  expect(numbers(/double model_mm = ([0-9.]+);\n/.exec(model)?.[1])).toEqual([modelMm.get("default")]);
  expect(/\{\{"lower_lip", ([0-9.]+)\}, \{"upper_lip", ([0-9.]+)\}\}/.exec(model)?.slice(1).map(Number)).toEqual([modelMm.get("lower_lip"), modelMm.get("upper_lip")]);
  expect(modelMm.size).toBe(3);
  expect(numbers(/kLowerJawForwardMm = ([0-9.]+);\n/.exec(forward)?.[1])).toEqual([PUBLISHED.operations.get("bsso_forward")?.modelMm.get("default")]);
});

/** A generator that gives the same numbers in every run (mulberry32), and from it the normal distribution. */
function normals(seed: number): () => number {
  const uniform = () => {
    seed = (seed + 0x6d2b79f5) | 0;
    let t = Math.imul(seed ^ (seed >>> 15), 1 | seed);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 2 ** 32;
  };
  return () => Math.sqrt(-2 * Math.log(1 - uniform())) * Math.cos(2 * Math.PI * uniform());
}

test("surgery and model together are what thousands of simulated operations show", async () => {
  const { file, shown, answers, plan } = await faceThatFollows(0.7, null);
  const bands = await wholeBands(shown, answers);
  const draw = normals(7);
  const jaw = file.surfaces.filter(({ entry }) => entry.handle === "mandible").flatMap(({ positions }) => Array.from({ length: positions.length / 3 }, (_, v) => pointAt(positions, v)));
  jaw.sort((a, b) => a[1] - b[1]);
  const foremost = jaw.slice(0, Math.max(1, Math.floor(jaw.length / 10)));
  const pose = plan.poses()[0];
  const front = movedPoint(pose, scaled(foremost.reduce(add), 1 / foremost.length));
  const skinRest = anchorPoint(file.surfaces[0], shown.landmarks.placed.get("soft_pogonion")!);
  const boneRest = anchorPoint(file.surfaces[1], shown.landmarks.placed.get("lower_midline")!);
  const [a, b, c] = corners({ positions: shown.positionsOf(0), triangles: file.surfaces[0].triangles }, 0);
  const normal = cross(subtract(b, a), subtract(c, a));
  const outward = scaled(normal, 1 / norm(normal));
  const skin: number[] = [];
  const bone: number[] = [];
  for (let i = 0; i < 40_000; ++i) {
    const turn = fromRotationVector(PUBLISHED.all.rotationDeg.map((deviation) => (draw() * deviation * Math.PI) / 180) as Vector);
    const shift = PUBLISHED.all.translationMm.map((deviation) => draw() * deviation) as Vector;
    const missed = (point: Vector) => add(add(front, apply(turn, subtract(movedPoint(pose, point), front))), shift);
    const onSkin = add(skinRest, scaled(subtract(missed(skinRest), skinRest), 0.7));
    skin.push(add(onSkin, scaled(outward, draw() * modelDeviation(PUBLISHED.all, "chin_midline")))[0]);
    bone.push(missed(boneRest)[0]);
  }
  const half = (values: number[]) => {
    const sorted = [...values].sort((x, y) => x - y);
    return (sorted[Math.floor(0.975 * sorted.length)] - sorted[Math.floor(0.025 * sorted.length)]) / 2;
  };
  const halfOf = (name: string) => ((bands?.get(name)?.highest ?? NaN) - (bands?.get(name)?.lowest ?? NaN)) / 2;
  expect(halfOf("chin_midline") / half(skin)).toBeCloseTo(1, 1.3);
  expect(halfOf("lower_midline") / half(bone)).toBeCloseTo(1, 1.3);
  expect(halfOf("lower_midline")).toBeGreaterThan(1.5);
});

test("the band of the material makes it wider, as independent parts add", async () => {
  const without = await faceThatFollows(0.7, null);
  const withBand = await faceThatFollows(0.7, 2);
  const half = async ({ shown, answers }: typeof without) => {
    const band = (await wholeBands(shown, answers))?.get("chin_midline");
    return ((band?.highest ?? NaN) - (band?.lowest ?? NaN)) / 2;
  };
  expect(await half(withBand)).toBeCloseTo(Math.hypot(await half(without), 2), 3);
  const [none, some] = await Promise.all([without, withBand].map(async ({ shown, answers }) => (await wholeBands(shown, answers))?.get("chin_midline")?.parts));
  expect(some).toEqual({ ...none, material: expect.closeTo(2) });
  expect(none?.material).toBeNull();
  // All of the model's part is the landmark's own, along its normal; bone has none.
  expect(none?.model).toBeLessThanOrEqual(1.96 * modelDeviation(PUBLISHED.all, "soft_glabella") + 1e-6);
  expect((await wholeBands(without.shown, without.answers))?.get("lower_midline")?.parts?.model).toBe(0);
});

test("where the page has no answers there is none", async () => {
  const { shown, answers } = await faceThatFollows(0.7, null);
  expect(await wholeBands(shown, { ...answers, skinPointsAt: async () => null })).toBeNull();
});
