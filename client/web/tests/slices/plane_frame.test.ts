// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { expect, test } from "vitest";
import type { Vector } from "../../src/geometry/rotation";
import { turnedNormal } from "../../src/slices/item_drag";
import { LPS, PLANES, angleDeg, distanceMm, letterOf, lineInSlice, planeFrame, positionText } from "../../src/slices/plane_frame";
import { sampleVolume } from "../../src/slices/sampling";
import { isComplete, measurementText } from "../../src/slices/slice_scene";
import { PRESETS, changedWindow, grayTable, wholeRange } from "../../src/slices/window_level";
import { goldenVolume } from "./golden_scene";

test("slices follow the radiological convention", () => {
  const letters = PLANES.map((plane) => {
    const { right, down, normal } = planeFrame(plane, LPS);
    return [right, down, normal].map(letterOf).join("");
  });
  expect(letters).toEqual(["LPS", "LIP", "PIL"]);
});

test.each(PLANES)("a bright voxel at the left, anterior and superior is where the letters of the %s slice say", (plane) => {
  // A RAS file's grid: the first axis goes to the right.
  const size = [9, 9, 9] as const;
  const values = new Int16Array(729).fill(-1000);
  const marker: Vector = [20, -20, 20];
  const grid = { size, spacing: [10, 10, 10] as Vector, origin: [40, -40, -40] as Vector, directions: [[-1, 0, 0], [0, 1, 0], [0, 0, 1]] as [Vector, Vector, Vector] };
  values[(40 - marker[0]) / 10 + 9 * ((marker[1] + 40) / 10 + 9 * ((marker[2] + 40) / 10))] = 1000;
  const { right, down, normal } = planeFrame(plane, LPS);
  const origin = [0, 1, 2].map((k) => -40 * (right[k] + down[k]) + normal[k] * marker.reduce((sum, value, axis) => sum + value * normal[axis], 0)) as Vector;
  const out = new Int16Array(81);
  sampleVolume({ grid, values, kernel: "" }, { origin, right: right.map((entry) => 10 * entry) as Vector, down: down.map((entry) => 10 * entry) as Vector, width: 9, height: 9 }, out);
  const at = out.indexOf(1000);
  const [x, y] = [at % 9, Math.floor(at / 9)];
  const side = x > 4 ? letterOf(right) : letterOf(right.map((entry) => -entry) as Vector);
  const height = y > 4 ? letterOf(down) : letterOf(down.map((entry) => -entry) as Vector);
  expect(`${height}${side}`).toBe({ axial: "AL", coronal: "SL", sagittal: "SA" }[plane]);
});

test("positions are named by their side", () => {
  expect(positionText([0, 0, 1], 12.34)).toBe("S 12.3 mm");
  expect(positionText([0, 0, 1], -3)).toBe("I 3.0 mm");
  expect(positionText([0, 1, 0], -3)).toBe("A 3.0 mm");
});

test("distances and angles are those of space", () => {
  expect(distanceMm([1, 2, 3], [4, 6, 15])).toBe(13);
  expect(angleDeg([1, 0, 0], [0, 0, 0], [0, 0, 2])).toBeCloseTo(90, 12);
  expect(angleDeg([0, 1, 0], [0, 0, 0], [0, -1, 1e-9])).toBeCloseTo(180, 5);
  const open = { kind: "angle" as const, plane: "axial" as const, points: [[1, 0, 0], [0, 0, 0]] as Vector[] };
  expect(isComplete(open)).toBe(false);
  expect(measurementText(open)).toBe("");
  expect(measurementText({ ...open, points: [...open.points, [1, 1, 0]] })).toBe("45.0°");
});

test("the line of a plane in a slice is on both", () => {
  const [point, normal, inSlice, sliceNormal]: Vector[] = [[3, 4, 5], [0.6, 0, 0.8], [0, 0, 1], [0, 0, 1]];
  const line = lineInSlice(point, normal, inSlice, sliceNormal);
  if (line === null) throw new Error("the plane crosses the slice");
  expect(line.at[2]).toBeCloseTo(1, 12);
  expect(line.at.reduce((sum, value, k) => sum + normal[k] * (value - point[k]), 0)).toBeCloseTo(0, 12);
  expect(Math.abs(line.along[1])).toBeCloseTo(1, 12);
  expect(lineInSlice(point, sliceNormal, inSlice, sliceNormal)).toBeNull();
});

test("a plane turns in the slice from right toward down", () => {
  const turned = turnedNormal([1, 0, 0], [1, 0, 0], [0, 1, 0], Math.PI / 6);
  expect(turned[0]).toBeCloseTo(Math.cos(Math.PI / 6), 12);
  expect(turned[1]).toBeCloseTo(0.5, 12);
});

test("a window maps its ends to black and white", () => {
  const table = grayTable({ center: 40, width: 400 });
  const grayOf = (value: number) => table[value + 32768];
  expect([-2000, -160, 40, 240, 3000].map(grayOf)).toEqual([0, 0, 128, 255, 255]);
  expect(changedWindow(PRESETS[0].window, 1e-9, 0).width).toBe(2);
  const { center, width } = wholeRange(goldenVolume());
  expect(Math.abs(center)).toBeLessThan(30);
  expect(width).toBeGreaterThan(1950);
});
