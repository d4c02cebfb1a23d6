// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { describe, expect, test } from "vitest";
import { coarserTriangles } from "../../src/building/coarse_surface";
import { surfaceNets } from "../../src/building/surface_nets";
import type { Grid } from "../../src/volume/volume";

const COUNT = 48;
const grid: Grid = { size: [COUNT, COUNT, COUNT], spacing: [1, 1, 1], origin: [0, 0, 0], directions: [[1, 0, 0], [0, 1, 0], [0, 0, 1]] };

function netOf(height: (x: number, y: number, z: number) => number) {
  const values = new Float32Array(COUNT ** 3);
  for (let k = 0, at = 0; k < COUNT; ++k) for (let j = 0; j < COUNT; ++j) for (let i = 0; i < COUNT; ++i) values[at++] = height(i - 23.5, j - 23.5, k - 23.5);
  return surfaceNets(grid, values, 0);
}

/** Twice the area of each triangle along +z and along -z, and six times the volume within. */
function measure(positions: Float32Array, triangles: Uint32Array) {
  let [up, down, volume] = [0, 0, 0];
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [0, 1, 2].map((corner) => [...positions.subarray(3 * triangles[t + corner], 3 * triangles[t + corner] + 3)]);
    const z = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    if (z > 0) up += z;
    else down -= z;
    volume += a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0]);
  }
  return { up, down, volume };
}

describe("fewer triangles of a surface", () => {
  const ball = netOf((x, y, z) => 18 - Math.hypot(x, y, z));

  test("keep its shape, and index its own vertices", () => {
    const all = ball.triangles.length / 3;
    const coarse = coarserTriangles(ball, grid.size, 1000);
    expect(all).toBeGreaterThan(4000);
    expect(coarse.length / 3).toBeGreaterThan(250);
    expect(coarse.length / 3).toBeLessThan(1200);
    expect(Math.max(...coarse)).toBeLessThan(ball.voxels.length);
    const share = measure(ball.positions, coarse).volume / measure(ball.positions, ball.triangles).volume;
    expect(share).toBeGreaterThan(0.9);
    expect(share).toBeLessThan(1.05);
  });

  test("are all of them where there are few", () => {
    expect(coarserTriangles(ball, grid.size, 1e6)).toBe(ball.triangles);
  });

  test("have both walls of bone that is thinner than a block", () => {
    // Three voxels thick; blocks have at least four.
    const plate = netOf((x, y, z) => Math.min(1.6 - Math.abs(z), 20.2 - Math.abs(x), 20.2 - Math.abs(y)));
    const coarse = coarserTriangles(plate, grid.size, Math.floor(plate.triangles.length / 3 / 13));
    const { up, down } = measure(plate.positions, coarse);
    const wall = 2 * 40 * 40;
    for (const area of [up, down]) expect(area / wall).toBeGreaterThan(0.8);
    for (const area of [up, down]) expect(area / wall).toBeLessThan(1.1);
  });
});
