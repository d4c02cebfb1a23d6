// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { expect, test, vi } from "vitest";
import type { Pose } from "../../src/geometry/pose";
import { restoreWork, workOf } from "../../src/workbench/work";

const POSE: Pose = { rotationVector: [0, 0.1, 0], pivotMm: [1, 2, 3], translationMm: [4, 5, 6], scale: 1 };

function bench(caseName = "cases/a") {
  const setPoses = vi.fn();
  return { caseName, plan: { poses: () => [POSE], setPoses }, posesByHandle: () => new Map([["mandible", POSE]]), setPoses };
}

test("poses come back as they were, over JSON", () => {
  const work: unknown = JSON.parse(JSON.stringify(workOf(bench())));
  const after = bench();
  restoreWork(after, work);
  expect(after.setPoses).toHaveBeenCalledWith(new Map([["mandible", POSE]]));
});

test.each([
  ["none", null],
  ["another case's", { caseName: "cases/b", poses: [["mandible", POSE]] }],
  ["no poses", { caseName: "cases/a", poses: 3 }],
  ["a pose without numbers", { caseName: "cases/a", poses: [["mandible", { ...POSE, pivotMm: [1, null, 3] }]] }],
  ["no pose", { caseName: "cases/a", poses: [["mandible", null], 4] }],
])("%s is left alone", (_, work) => {
  const after = bench();
  restoreWork(after, work);
  expect(after.setPoses).not.toHaveBeenCalled();
});
