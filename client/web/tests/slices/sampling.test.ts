// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { expect, test } from "vitest";
import { add, scaled } from "../../src/geometry/rotation";
import { PLANES, planeFrame } from "../../src/slices/plane_frame";
import { OUTSIDE, type Patch, sampleLabels, sampleVolume } from "../../src/slices/sampling";
import { PRESETS } from "../../src/slices/window_level";
import { golden, goldenAxes, goldenVolume } from "./golden_scene";

/** The width of the narrowest preset: as many units are 255 gray levels. */
const NARROWEST = Math.min(...PRESETS.map(({ window }) => window.width));
const [WIDTH, HEIGHT, PIXEL_MM] = [48, 40, 0.6];

function goldenPatch(plane: (typeof PLANES)[number]): Patch {
  const { right, down } = planeFrame(plane, goldenAxes);
  const origin = add(golden.middle, add(scaled(right, (-WIDTH / 2) * PIXEL_MM), scaled(down, (-HEIGHT / 2) * PIXEL_MM)));
  return { origin, right: scaled(right, PIXEL_MM), down: scaled(down, PIXEL_MM), width: WIDTH, height: HEIGHT };
}

test.each(PLANES)("an oblique %s slice of an anisotropic grid is VTK's to half a gray level", (plane) => {
  const values = new Int16Array(WIDTH * HEIGHT);
  sampleVolume(goldenVolume(), goldenPatch(plane), values);
  const expected = golden.slices[plane];
  let [inside, largest, border] = [0, 0, 0];
  values.forEach((value, i) => {
    const isOut = expected[i] === OUTSIDE;
    if (isOut !== (value === OUTSIDE)) ++border;
    if (isOut || value === OUTSIDE) return;
    ++inside;
    largest = Math.max(largest, Math.abs(value - expected[i]));
  });
  expect(inside).toBeGreaterThan(500);
  // Half a unit is the rounding to an integer; VTK's weights are float32, which adds up to 0.01 to values of 1000.
  expect(largest).toBeLessThan(0.51);
  expect((largest * 255) / NARROWEST).toBeLessThan(0.5);
  expect(border).toBe(0);
});

test("at the center of a voxel is the voxel's value, and its label", () => {
  const { grid, values } = goldenVolume();
  const [i, j, k] = [7, 11, 3];
  const at = i + grid.size[0] * (j + grid.size[1] * k);
  const center = grid.directions.reduce((point, direction, axis) => add(point, scaled(direction, [i, j, k][axis] * grid.spacing[axis])), grid.origin);
  const patch: Patch = { origin: center, right: [0.01, 0, 0], down: [0, 0.01, 0], width: 1, height: 1 };
  const value = new Int16Array(1);
  sampleVolume({ grid, values, kernel: "" }, patch, value);
  expect(value[0]).toBe(values[at]);
  const labels = new Uint8Array(values.length);
  labels[at] = 9;
  const label = new Uint16Array(1);
  sampleLabels({ grid, values: labels, names: new Map() }, patch, label);
  expect(label[0]).toBe(9);
});

test("a grid of one slice, sheared and left-handed, is sampled without NaN", () => {
  const size = [4, 3, 1] as const;
  const grid = { size, spacing: [1, 1, 5] as [number, number, number], origin: [0, 0, 0] as [number, number, number], directions: [[1, 0, 0], [0, 0.8, 0.6], [0, 0, -1]] as [[number, number, number], [number, number, number], [number, number, number]] };
  const values = Int16Array.from({ length: 12 }, (_, i) => 100 * i);
  const out = new Int16Array(5);
  sampleVolume({ grid, values, kernel: "" }, { origin: [0, 0.8, 0.6], right: [1, 0, 0], down: [0, 1, 0], width: 5, height: 1 }, out);
  expect(Array.from(out)).toEqual([400, 500, 600, 700, OUTSIDE]);
});
