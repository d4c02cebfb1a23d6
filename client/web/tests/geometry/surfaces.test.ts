// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { describe, expect, test } from "vitest";
import { VIRIDIS, colorTable, colorize, roundUp } from "../../src/geometry/color_map";
import { FollowingSurface, vertexNormals } from "../../src/geometry/following_surface";
import { BoneSolid, PenetrationTest } from "../../src/geometry/penetration";
import { movedPoint } from "../../src/geometry/pose";
import { pointAt, rigidPose, spreadTriple } from "../../src/geometry/rigid_fit";
import type { Vector } from "../../src/geometry/rotation";

/** A closed ball about `middle`. */
function ball(radius: number, middle: Vector, rings = 16): { positions: Float32Array; triangles: Uint32Array } {
  const positions: number[] = [];
  const triangles: number[] = [];
  for (let i = 0; i <= rings; ++i) {
    for (let j = 0; j < 2 * rings; ++j) {
      const [theta, phi] = [(Math.PI * i) / rings, (Math.PI * j) / rings];
      const unit = [Math.sin(theta) * Math.cos(phi), Math.sin(theta) * Math.sin(phi), Math.cos(theta)];
      unit.forEach((part, k) => positions.push(middle[k] + radius * part));
      if (i === rings) continue;
      const [a, b] = [2 * rings * i + j, 2 * rings * i + ((j + 1) % (2 * rings))];
      triangles.push(a, a + 2 * rings, b, b, a + 2 * rings, b + 2 * rings);
    }
  }
  return { positions: Float32Array.from(positions), triangles: Uint32Array.from(triangles) };
}

describe("a surface that follows", () => {
  const { positions, triangles } = ball(10, [0, 0, 0]);
  const count = positions.length / 3;
  // The upper half follows two points of the list, by height.
  const places = new Uint32Array(3 * count);
  const weights = new Float32Array(3 * count);
  for (let v = 0; v < count; ++v) {
    const height = Math.max(0, positions[3 * v + 2] / 10);
    places.set([0, 1, 0], 3 * v);
    weights.set([height / 2, height / 2, 0], 3 * v);
  }
  const surface = () => new FollowingSurface(positions, triangles, { places, weights });

  test("is at rest without displacements", () => {
    const shape = surface();
    shape.move(new Float32Array(6));
    expect(shape.positions).toEqual(positions);
    vertexNormals(positions, triangles).forEach((part, i) => expect(shape.normals[i]).toBeCloseTo(part, 5));
  });

  test("moves by the weighted sum, and only where it has weights", () => {
    const shape = surface();
    shape.move(Float32Array.from([1, 0, 0, 3, 0, 4]));
    for (let v = 0; v < count; ++v) {
      const height = Math.max(0, positions[3 * v + 2] / 10);
      expect(shape.positions[3 * v]).toBeCloseTo(positions[3 * v] + 2 * height, 4);
      expect(shape.positions[3 * v + 2]).toBeCloseTo(positions[3 * v + 2] + 2 * height, 4);
    }
    expect(shape.movingCount).toBeLessThan(0.6 * count);
  });

  test("has the normals of its moved triangles everywhere", () => {
    const shape = surface();
    shape.move(Float32Array.from([5, -2, 8, 3, 1, 9]));
    const expected = vertexNormals(shape.positions, triangles);
    expected.forEach((part, i) => expect(shape.normals[i]).toBeCloseTo(part, 4));
    shape.move(new Float32Array(6));
    vertexNormals(positions, triangles).forEach((part, i) => expect(shape.normals[i]).toBeCloseTo(part, 4));
  });

  test("spreads numbers and lengths of vectors", () => {
    const shape = surface();
    const out = new Float32Array(count);
    shape.spreadLengths(Float32Array.from([3, 0, 4, 3, 0, 4]), out);
    expect(Math.max(...out)).toBeCloseTo(5, 5);
    expect(out[count - 1]).toBe(0);
    shape.spread(Float32Array.from([2, 4]), out);
    expect(Math.max(...out)).toBeCloseTo(3, 5);
  });
});

describe("a rigid fit", () => {
  const points = Float32Array.from([0, 0, 0, 30, 0, 0, 0, 20, 0, 1, 0, 0]);
  const pose = { rotationVector: [0.2, -0.1, 0.4] as Vector, pivotMm: [5, 6, 7] as Vector, translationMm: [1, -8, 2] as Vector, scale: 1 };

  test("finds the pose from three points", () => {
    const triple = spreadTriple(points, [0, 1, 2, 3])!;
    const rest = triple.map((v) => pointAt(points, v)) as [Vector, Vector, Vector];
    const found = rigidPose(rest, rest.map((point) => movedPoint(pose, point)) as [Vector, Vector, Vector]);
    for (const point of [[3, 4, 50], [-10, 2, 1]] as Vector[]) {
      movedPoint(found, point).forEach((part, k) => expect(part).toBeCloseTo(movedPoint(pose, point)[k], 9));
    }
  });

  test("needs three points off a line", () => {
    expect(spreadTriple(points, [0, 1])).toBeNull();
    expect(spreadTriple(points, [0, 1, 3])).toBeNull();
    expect(spreadTriple(points, [0, 0, 0])).toBeNull();
  });
});

describe("bone in bone", () => {
  const solid = (name: string, handle: string, middle: Vector) => {
    const { positions, triangles } = ball(10, middle, 24);
    return new BoneSolid(name, handle, positions, triangles);
  };
  const test2 = new PenetrationTest([solid("skull", "", [0, 0, 0]), solid("mandible", "mandible", [0, 0, 21])]);
  const moved = (z: number) => new Map([["mandible", { rotationVector: [0, 0, 0] as Vector, pivotMm: [0, 0, 0] as Vector, translationMm: [0, 0, z] as Vector, scale: 1 }]]);

  test("is nothing at rest and apart", () => {
    expect(test2.find(new Map())).toEqual([]);
    expect(test2.find(moved(5))).toEqual([]);
  });

  test("is reported with its depth and places", () => {
    const [found] = test2.find(moved(-4));
    expect(found).toMatchObject({ segment: "mandible", other: "skull" });
    expect(found.depthMm).toBeGreaterThan(2.2);
    expect(found.depthMm).toBeLessThan(3.2);
    expect(found.points.length).toBeGreaterThan(3);
  });

  test("that lay in bone at rest is not counted", () => {
    const overlapping = new PenetrationTest([solid("skull", "", [0, 0, 0]), solid("mandible", "mandible", [0, 0, 17])]);
    expect(overlapping.find(new Map())).toEqual([]);
    expect(overlapping.find(moved(-2)).length).toBe(1);
  });
});

describe("the colour map", () => {
  const table = colorTable(VIRIDIS);
  const lightness = Array.from({ length: 256 }, (_, i) => lab(table[3 * i], table[3 * i + 1], table[3 * i + 2]));

  test("rises in lightness all the way", () => {
    for (let i = 8; i < 256; i += 8) expect(lightness[i][0]).toBeGreaterThan(lightness[i - 8][0]);
  });

  test("has steps that look alike", () => {
    const steps: number[] = [];
    for (let i = 16; i < 256; i += 16) steps.push(Math.hypot(...lightness[i].map((part, k) => part - lightness[i - 16][k])));
    expect(Math.max(...steps) / Math.min(...steps)).toBeLessThan(2.5);
  });

  test("keeps to its ends", () => {
    const out = new Uint8Array(9);
    colorize(Float32Array.from([-1, 0, 99]), 4, table, out);
    expect(Array.from(out)).toEqual([...table.slice(0, 3), ...table.slice(0, 3), ...table.slice(-3)]);
    colorize(Float32Array.from([0, 0, 0]), 0, table, out);
    expect(Array.from(out.slice(6))).toEqual(Array.from(table.slice(0, 3)));
  });

  test.each([[0, 0.1], [0.02, 0.1], [1, 1], [1.2, 1.5], [7.3, 8], [8.001, 10], [43, 50]])("a range of %d mm is shown to %d", (value, most) => {
    expect(roundUp(value)).toBe(most);
  });
});

/** CIE L*a*b* of an sRGB color. */
function lab(...rgb: number[]): [number, number, number] {
  const [r, g, b] = rgb.map((byte) => (byte / 255 <= 0.04045 ? byte / 255 / 12.92 : ((byte / 255 + 0.055) / 1.055) ** 2.4));
  const f = (t: number) => (t > 0.008856 ? Math.cbrt(t) : 7.787 * t + 16 / 116);
  const x = f((0.4124 * r + 0.3576 * g + 0.1805 * b) / 0.9505);
  const y = f(0.2126 * r + 0.7152 * g + 0.0722 * b);
  const z = f((0.0193 * r + 0.1192 * g + 0.9505 * b) / 1.089);
  return [116 * y - 16, 500 * (x - y), 200 * (y - z)];
}
