// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { expect, test } from "vitest";
import { type Vector, dot, norm, scaled, subtract } from "../../src/geometry/rotation";
import { MeshCut } from "../../src/slices/mesh_cut";
import { SliceScene } from "../../src/slices/slice_scene";
import { golden, goldenTorus } from "./golden_scene";

const POINT: Vector = [3.3, -1.7, 0.9];

function segments(lines: readonly Float32Array[]): [Vector, Vector][] {
  return lines.flatMap((line) => Array.from({ length: line.length / 3 - 1 }, (_, i): [Vector, Vector] => [Array.from(line.slice(3 * i, 3 * i + 3)) as Vector, Array.from(line.slice(3 * i + 3, 3 * i + 6)) as Vector]));
}

function toSegment(point: Vector, [a, b]: [Vector, Vector]): number {
  const along = subtract(b, a);
  const share = Math.max(0, Math.min(1, dot(subtract(point, a), along) / Math.max(1e-12, dot(along, along))));
  return norm(subtract(subtract(point, a), scaled(along, share)));
}

const length = (all: [Vector, Vector][]) => all.reduce((sum, [a, b]) => sum + norm(subtract(b, a)), 0);

test.each([
  ["flat", [0, 0, 1], 2],
  ["across", [1, 0, 0], 2],
  ["oblique", [0.48, 0.6, 0.64], 2],
] as [keyof typeof golden.cuts, Vector, number][])("the %s cut is VTK's, in closed lines", (name, normal, loops) => {
  const { positions, triangles } = goldenTorus();
  const lines = new MeshCut(positions, triangles).cut(POINT, normal);
  const ours = segments(lines);
  const theirs = golden.cuts[name].map(([a, b, c, d, e, f]): [Vector, Vector] => [[a, b, c], [d, e, f]]);
  expect(Math.abs(length(ours) - length(theirs))).toBeLessThan(0.01);
  for (const [from] of ours) expect(Math.min(...theirs.map((segment) => toSegment(from, segment)))).toBeLessThan(1e-3);
  for (const [from] of theirs) expect(Math.min(...ours.map((segment) => toSegment(from, segment)))).toBeLessThan(1e-3);
  expect(lines.length).toBe(loops);
  for (const line of lines) expect(Array.from(line.slice(0, 3))).toEqual(Array.from(line.slice(-3)));
});

test("a mesh that moved is cut where it is now", () => {
  const { positions, triangles } = goldenTorus();
  const cut = new MeshCut(positions, triangles);
  const moved = positions.map((value, i) => (i % 3 === 2 ? value + 50 : value));
  expect(cut.cut([0, 0, 50], [0, 0, 1])).toEqual([]);
  cut.fit(moved);
  expect(cut.cut(POINT, [0, 0, 1])).toEqual([]);
  expect(cut.cut([3.3, -1.7, 50.9], [0, 0, 1]).length).toBe(2);
});

test("a surface with an edge gives an open line, and three triangles at an edge give all their lines", () => {
  const positions = Float32Array.from([0, 0, -1, 0, 0, 1, 1, 0, 0.5, -1, 0, 0.5, 0, 1, 0.5]);
  const fan = new MeshCut(positions, Uint32Array.from([0, 1, 2, 0, 1, 3, 0, 1, 4]));
  expect(length(segments(fan.cut([0, 0, 0], [0, 0, 1])))).toBeCloseTo(3 * (2 / 3), 5);
});

test("skin before and after share triangles, and each keeps its own cut", () => {
  const { positions, triangles } = goldenTorus();
  const before = { name: "before", color: "#fff", positions, triangles };
  const after = (z: number) => ({ name: "after", color: "#fff", positions: positions.map((value, i) => (i % 3 === 2 ? value + z : value)), triangles });
  const scene = new SliceScene();
  for (const z of [0, 50, 100]) {
    scene.setOutlines([before, after(z)]);
    expect(scene.outlines.map(({ mesh }) => mesh.cut([0, 0, z], [0, 0, 1]).length)).toEqual([z === 0 ? 2 : 0, 2]);
  }
});

test("a cut of a large mesh follows a drag (printed, not asserted)", () => {
  const side = 550;
  const positions = new Float32Array(3 * side * side);
  const triangles: number[] = [];
  for (let i = 0; i < side; ++i) {
    for (let j = 0; j < side; ++j) {
      const [u, v] = [(i / (side - 1)) * Math.PI, (j / (side - 1)) * 2 * Math.PI];
      positions.set([90 * Math.sin(u) * Math.cos(v), 90 * Math.sin(u) * Math.sin(v), 90 * Math.cos(u)], 3 * (i * side + j));
      if (i + 1 < side && j + 1 < side) triangles.push(i * side + j, (i + 1) * side + j, (i + 1) * side + j + 1, i * side + j, (i + 1) * side + j + 1, i * side + j + 1);
    }
  }
  const began = performance.now();
  const cut = new MeshCut(positions, Uint32Array.from(triangles));
  const built = performance.now();
  for (let i = 0; i < 20; ++i) cut.fit(positions);
  const fitted = performance.now();
  let lines = 0;
  for (let i = 0; i < 100; ++i) lines += cut.cut([0, 0, i - 50], [0, 0, 1]).length;
  const done = performance.now();
  console.log(`${triangles.length / 3} triangles: ordered in ${(built - began).toFixed(0)} ms, fitted in ${((fitted - built) / 20).toFixed(2)} ms, cut in ${((done - fitted) / 100).toFixed(2)} ms`);
  expect(lines).toBe(100);
});
