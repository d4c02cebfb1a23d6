// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { expect, test } from "vitest";
import { openCase } from "../../src/case/case_file";
import { FollowingSurface } from "../../src/geometry/following_surface";
import { type Anchor, anchorPoint } from "../../src/measures/anchor";
import { skinPointsAt } from "../../src/measures/skin_points";
import { smallCase, sourceOf } from "../testing/small_case";

test("points are where the whole surface has them, and only what they move by is asked for", async () => {
  const file = await openCase(sourceOf(smallCase()));
  const count = file.followed.length;
  const rest = Float32Array.from({ length: 3 * count }, (_, i) => (i * 37) % 11);
  const displacements = Float32Array.from({ length: 3 * count }, (_, i) => ((i * 29) % 7) / 4);
  const { positions, triangles, follows } = file.surfaces[0];
  const anchors: Anchor[] = [{ surface: 0, triangle: 0, weights: [0.2, 0.3, 0.5] }, { surface: 0, triangle: triangles.length / 3 - 1, weights: [0, 1, 0] }];
  let asked = new Int32Array();
  const points = await skinPointsAt(file, rest, async (sets, vertices) => {
    asked = Int32Array.from(vertices);
    return Float32Array.from(sets.flatMap((_, set) => Array.from(vertices).flatMap((v) => [0, 1, 2].map((k) => rest[3 * v + k] + (set + 1) * displacements[3 * v + k]))));
  }, [[], []], anchors);
  expect(new Set(asked).size).toBe(asked.length);
  expect(asked.length).toBeGreaterThan(0);
  expect(asked.length).toBeLessThanOrEqual(9);
  const shape = new FollowingSurface(positions, triangles, follows);
  for (const set of [0, 1]) {
    const whole = positions.slice();
    shape.follow(displacements.map((value) => (set + 1) * value), whole);
    anchors.forEach((anchor, i) => anchorPoint({ positions: whole, triangles }, anchor).forEach((at, k) => expect(points?.[set][i][k]).toBeCloseTo(at, 4)));
  }
  expect(await skinPointsAt(file, rest, async () => null, [[]], anchors)).toBeNull();
});
