// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { describe, expect, test } from "vitest";
import { placeOf, reduceVolume, resampleLabels } from "../../src/building/bone_grid";
import { FIXED_BONE, Jaw, boneVoxels, cutPieces, cutsNear } from "../../src/building/pieces";
import type { Plane } from "../../src/building/recipe";
import { surfaceNets } from "../../src/building/surface_nets";
import type { Vector } from "../../src/geometry/rotation";
import type { Grid } from "../../src/volume/volume";

const SQUARE: Grid["directions"] = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
const grid: Grid = { size: [20, 10, 10], spacing: [2, 2, 2], origin: [-10, 0, 5], directions: SQUARE };
const up = (z: number): Plane => ({ point_mm: [0, 0, z], normal: [0, 0, 3] });

function filled(inside: (point: Vector) => boolean): Float32Array {
  const values = new Float32Array(grid.size[0] * grid.size[1] * grid.size[2]);
  let at = 0;
  for (let k = 0; k < grid.size[2]; ++k) for (let j = 0; j < grid.size[1]; ++j) for (let i = 0; i < grid.size[0]; ++i) values[at++] = inside(placeOf(grid, i, j, k)) ? 1000 : -1000;
  return values;
}

describe("pieces", () => {
  const block = boneVoxels(grid, filled(([x]) => x < 0 || x > 10), 250, null);

  test("a cut takes what is on the positive side, and of that the largest connected piece", () => {
    // Left of the gap there are 5 layers of 100 voxels, right of it 9.
    const { labels, volumesMm3 } = cutPieces(block, [{ osteotomy: "bssro", planes: [up(14)] }], null);
    expect(volumesMm3).toEqual([9 * 10 * 5 * 8]);
    const at = (i: number, j: number, k: number) => labels[(k * 10 + j) * 20 + i];
    expect([at(15, 3, 4), at(15, 3, 5), at(2, 3, 9), at(8, 3, 9)]).toEqual([FIXED_BONE, 2, FIXED_BONE, 0]);
  });

  test("a later segment is cut out of earlier ones; one without planes takes nothing", () => {
    const cuts = [{ osteotomy: "bssro" as const, planes: [up(14)] }, { osteotomy: "bssro" as const, planes: [] }, { osteotomy: "genioplasty" as const, planes: [up(20)] }];
    expect(cutPieces(block, cuts, null).volumesMm3).toEqual([9 * 10 * 3 * 8, 0, 9 * 10 * 2 * 8]);
  });

  test("each jaw lies on its side of the occlusal plane, unless a label says so", () => {
    const cut = (osteotomy: "bssro" | "le_fort_1") => [{ osteotomy, planes: [up(-100)] }];
    expect(cutPieces(block, cut("bssro"), up(14)).volumesMm3).toEqual([9 * 10 * 5 * 8]);
    expect(cutPieces(block, cut("le_fort_1"), up(18)).volumesMm3).toEqual([9 * 10 * 3 * 8]);
    const labelled = boneVoxels(grid, filled(() => true), 250, new Uint8Array(2000).fill(Jaw.lower, 0, 1000));
    expect(cutPieces(labelled, cut("bssro"), up(-100)).volumesMm3[0]).toBe(1000 * 8);
  });

  test("cuts near a structure are reported with their distance", () => {
    const canal = Float32Array.from([0, 5, 20, 0, 5, 16.5]);
    const cuts = [{ osteotomy: "bssro" as const, planes: [up(15)] }];
    expect(cutsNear(cuts, new Map([["canal", canal]]), 2, 1)).toEqual([{ segment: 0, structure: "canal", distanceMm: 1.5 }]);
    expect(cutsNear(cuts, new Map([["canal", canal]]), 1, 1)).toEqual([]);
    expect(cutsNear([{ osteotomy: "bssro", planes: [up(16.2)] }], new Map([["canal", canal]]), 2, 1)[0].distanceMm).toBe(0);
    // A plane that passes there, but in a part of it that another plane cuts away.
    const aside = [{ osteotomy: "bssro" as const, planes: [up(16.5), { point_mm: [30, 0, 0] as Vector, normal: [1, 0, 0] as Vector }] }];
    expect(cutsNear(aside, new Map([["canal", canal]]), 2, 1)).toEqual([]);
  });
});

describe("the surface", () => {
  const radius = 7;
  const ball = new Float32Array(24 ** 3);
  const at = (directions: Grid["directions"]): Grid => ({ size: [24, 24, 24], spacing: [1, 1, 1], origin: [3, -2, 1], directions });
  for (let k = 0, index = 0; k < 24; ++k) for (let j = 0; j < 24; ++j) for (let i = 0; i < 24; ++i) ball[index++] = radius - Math.hypot(i - 11.5, j - 11.5, k - 11.5);

  test.each([
    ["along the patient's axes", SQUARE],
    ["mirrored", [[-1, 0, 0], [0, 1, 0], [0, 0, 1]] as Grid["directions"]],
    ["turned", [[0.6, 0.8, 0], [-0.8, 0.6, 0], [0, 0, 1]] as Grid["directions"]],
  ])("of a ball is closed, faces outward and has its volume: %s", (_, directions) => {
    const { positions, triangles, voxels } = surfaceNets(at(directions), ball, 0);
    const edges = new Map<string, number>();
    let volume = 0;
    for (let t = 0; t < triangles.length; t += 3) {
      const [a, b, c] = [0, 1, 2].map((corner) => positions.subarray(3 * triangles[t + corner], 3 * triangles[t + corner] + 3));
      volume += (a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0])) / 6;
      for (const corner of [0, 1, 2]) {
        const [from, to] = [triangles[t + corner], triangles[t + ((corner + 1) % 3)]];
        edges.set(`${from} ${to}`, (edges.get(`${from} ${to}`) ?? 0) + 1);
      }
    }
    for (const [edge, count] of edges) expect([count, edges.get(edge.split(" ").reverse().join(" "))]).toEqual([1, 1]);
    const exact = (4 / 3) * Math.PI * radius ** 3;
    expect(volume / exact).toBeGreaterThan(0.97);
    expect(volume / exact).toBeLessThan(1.01);
    expect(Array.from(voxels).every((voxel) => ball[voxel] >= 0)).toBe(true);
  });
});

describe("the reduced volume", () => {
  test("has the means of blocks at their middles", async () => {
    const fine: Grid = { size: [5, 4, 2], spacing: [0.5, 0.75, 1.5], origin: [1, 2, 3], directions: [[0, 1, 0], [-1, 0, 0], [0, 0, 1]] };
    const values = Int16Array.from({ length: 40 }, (_, index) => index);
    const reduced = await reduceVolume({ grid: fine, values, kernel: "" }, 1.5);
    expect(reduced.grid.size).toEqual([1, 2, 2]);
    expect(reduced.grid.spacing).toEqual([1.5, 1.5, 1.5]);
    // Voxels 0 to 2 and 5 to 7 of the first slice.
    expect(reduced.values[0]).toBeCloseTo((0 + 1 + 2 + 5 + 6 + 7) / 6, 5);
    expect(placeOf(reduced.grid, 0, 0, 0)).toEqual(placeOf(fine, 1, 0.5, 0));
    expect(placeOf(reduced.grid, 0, 1, 1)).toEqual(placeOf(fine, 1, 2.5, 1));
  });

  test("takes labels from a map on another grid", () => {
    const map = { grid: { size: [2, 2, 2], spacing: [10, 10, 10], origin: [-5, 0, 5], directions: SQUARE } as Grid, values: Uint8Array.from([7, 9, 7, 9, 7, 9, 7, 9]), names: new Map() };
    const codes = resampleLabels(map, new Map([[9, Jaw.upper]]), grid);
    const found = (i: number) => codes[(2 * 10 + 2) * 20 + i];
    // Nearest to x = -5 (a number without a code), to x = 5, and beyond the map.
    expect([found(0), found(7), found(19)]).toEqual([0, Jaw.upper, 0]);
  });
});
