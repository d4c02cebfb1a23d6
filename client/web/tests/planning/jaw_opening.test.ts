// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { expect, test } from "vitest";
import { openCase } from "../../src/case/case_file";
import { type Pose, movedPoint } from "../../src/geometry/pose";
import type { Vector } from "../../src/geometry/rotation";
import { type HingeAxis, hingeAxis, incisorDistanceMm, lowerJawHandles, opened } from "../../src/planning/jaw_opening";
import { smallCase, sourceOf } from "../testing/small_case";

const HINGE: HingeAxis = { left: [50, 0, 0], right: [-50, 0, 0], source: "landmarks" };
const MOVED: Pose = { rotationVector: [0.1, -0.05, 0.2], pivotMm: [5, -60, -30], translationMm: [1, -4, 2], scale: 1 };

test("an opening by a quarter turn takes what lies in front of the hinge below it", () => {
  const rest: Pose = { rotationVector: [0, 0, 0], pivotMm: [3, 4, 5], translationMm: [0, 0, 0], scale: 1 };
  expect(movedPoint(opened(rest, HINGE, 90), [0, -80, 0])).toEqual([0, 0, -80].map((part) => expect.closeTo(part, 9)));
});

test("the hinge itself stays, distances on the jaw stay, and closing brings the planned pose back", () => {
  const rest: Pose = { rotationVector: [0, 0, 0], pivotMm: [3, 4, 5], translationMm: [0, 0, 0], scale: 1 };
  for (const end of [HINGE.left, HINGE.right]) expect(movedPoint(opened(rest, HINGE, 17), end)).toEqual(end.map((part) => expect.closeTo(part, 9)));
  const back = opened(opened(MOVED, HINGE, 12), HINGE, -12);
  for (const point of [[0, 0, 0], [10, -70, -40]] as Vector[]) {
    expect(movedPoint(back, point)).toEqual(movedPoint(MOVED, point).map((part) => expect.closeTo(part, 9)));
  }
  expect(opened(MOVED, HINGE, 0)).toBe(MOVED);
});

test("the hinge goes through the landmarks of the condyles where the case has them, else through the ends of the jaw", async () => {
  const landmark = (name: string, x: number) => ({ name, label: name, position_mm: [x, 90, 40] });
  const bytes = smallCase({ json: ({ extensions }) => extensions.TISSUEFORM_case.landmarks.push(landmark("condyle_left", 45), landmark("condyle_right", -45)) });
  expect(hingeAxis(await openCase(sourceOf(bytes)))).toEqual({ left: [45, 90, 40], right: [-45, 90, 40], source: "landmarks" });
  const wide = await openCase(sourceOf(smallCase()));
  const segment = wide.surfaces[1];
  const positions = Float32Array.from([20, 0, 0, -20, 0, 0, 20, 30, 30, -20, 28, 31]);
  const fitted = hingeAxis({ ...wide, surfaces: [{ ...segment, positions }] });
  expect(fitted).toEqual({ left: [20, 30, 30], right: [-20, 28, 31], source: "ends of the lower jaw" });
  expect(hingeAxis(wide)).toBeNull();
});

test("handles that carry the chin go along, and incisors show how far the mouth is open", async () => {
  const landmark = (name: string, y: number, handle: string) => ({ name, label: name, position_mm: [0, y, 0], ...(handle === "" ? {} : { handle }) });
  const bytes = smallCase({ json: ({ extensions }) => extensions.TISSUEFORM_case.landmarks.push(landmark("upper_incisor", -82, ""), landmark("lower_incisor", -80, "mandible")) });
  const file = await openCase(sourceOf(bytes));
  expect(lowerJawHandles(file)).toEqual(["mandible"]);
  expect(incisorDistanceMm(file, new Map())).toBeCloseTo(2, 9);
  const rest: Pose = { rotationVector: [0, 0, 0], pivotMm: [0, 0, 0], translationMm: [0, 0, 0], scale: 1 };
  expect(incisorDistanceMm(file, new Map([["mandible", opened(rest, HINGE, 90)]]))).toBeCloseTo(Math.hypot(82, 80), 9);
  expect(incisorDistanceMm(await openCase(sourceOf(smallCase())), new Map())).toBeNull();
});
