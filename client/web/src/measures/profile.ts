// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type HeadFrame, headAxes } from "../geometry/pose";
import { type Vector, apply } from "../geometry/rotation";
import type { Triangles } from "./anchor";

/** A point of the midsagittal section, in the head frame, in mm. */
export interface ProfilePoint {
  forward: number;
  up: number;
}

/** A piece of the section, from one end to the other. */
export type ProfileLine = ProfilePoint[];

/** The section of a surface by the midsagittal plane, the line of most points first. */
export function cutProfile(shape: Triangles, frame: HeadFrame): ProfileLine[] {
  const axes = headAxes(frame);
  const [left0, back0, up0] = apply(axes, frame.originMm);
  const { positions, triangles } = shape;
  const left = new Float32Array(positions.length / 3);
  for (let v = 0; v < left.length; ++v) {
    const height = axes[0] * positions[3 * v] + axes[1] * positions[3 * v + 1] + axes[2] * positions[3 * v + 2] - left0;
    // A vertex in the plane is taken to one side of it: each triangle is then cut in two points or in none.
    left[v] = height === 0 ? 1e-6 : height;
  }
  const crossing = (a: number, b: number): ProfilePoint => {
    const share = left[a] / (left[a] - left[b]);
    const at = [0, 1, 2].map((k) => positions[3 * a + k] + share * (positions[3 * b + k] - positions[3 * a + k])) as Vector;
    const [, back, up] = apply(axes, at);
    return { forward: back0 - back, up: up - up0 };
  };
  const segments: Segment[] = [];
  for (let t = 0; t < triangles.length; t += 3) {
    const ends = [0, 1, 2].flatMap((k) => {
      const [a, b] = [triangles[t + k], triangles[t + ((k + 1) % 3)]];
      return left[a] > 0 === left[b] > 0 ? [] : [{ key: edgeKey(a, b, left.length), point: crossing(Math.min(a, b), Math.max(a, b)) }];
    });
    if (ends.length === 2) segments.push({ keys: [ends[0].key, ends[1].key], points: [ends[0].point, ends[1].point] });
  }
  return join(segments);
}

/** The triangles that lie within `reachMm` of the plane: what a moving face brings into it, at a fraction of the whole. */
export function nearMiddle(shape: Triangles, frame: HeadFrame, reachMm: number): Uint32Array {
  const { left, originMm } = frame;
  const { positions, triangles } = shape;
  const kept: number[] = [];
  for (let t = 0; t < triangles.length; t += 3) {
    const at = 3 * triangles[t];
    const off = [0, 1, 2].reduce((sum, k) => sum + left[k] * (positions[at + k] - originMm[k]), 0);
    if (Math.abs(off) <= reachMm) kept.push(triangles[t], triangles[t + 1], triangles[t + 2]);
  }
  return Uint32Array.from(kept);
}

interface Segment {
  keys: [number, number];
  points: [ProfilePoint, ProfilePoint];
}

function edgeKey(a: number, b: number, count: number): number {
  return Math.min(a, b) * count + Math.max(a, b);
}

/** Segments that share the edge of a triangle, one after the other; the longest line first. */
function join(segments: Segment[]): ProfileLine[] {
  const at = new Map<number, number[]>();
  segments.forEach(({ keys }, index) => keys.forEach((key) => at.set(key, [...(at.get(key) ?? []), index])));
  const isUsed = new Uint8Array(segments.length);
  const walk = (from: number, end: 0 | 1): ProfileLine => {
    const line: ProfileLine = [];
    for (let index = from, out = end; ; ) {
      const key = segments[index].keys[out];
      const next = (at.get(key) ?? []).find((other) => isUsed[other] === 0);
      if (next === undefined) return line;
      isUsed[next] = 1;
      const enters = segments[next].keys[0] === key ? 0 : 1;
      out = enters === 0 ? 1 : 0;
      line.push(segments[next].points[out]);
      index = next;
    }
  };
  const lines: ProfileLine[] = [];
  segments.forEach(({ points }, index) => {
    if (isUsed[index] === 1) return;
    isUsed[index] = 1;
    const forth = walk(index, 1);
    lines.push([...walk(index, 0).reverse(), points[0], points[1], ...forth]);
  });
  return lines.sort((a, b) => b.length - a.length);
}

const LEVEL_MM = 0.25;

/** Of each level from the top down the foremost point of the lines: the outline of the face, without what lies behind it. */
export function outline(lines: readonly ProfileLine[]): ProfilePoint[] {
  const foremost = new Map<number, number>();
  for (const line of lines) {
    for (let i = 1; i < line.length; ++i) {
      const [low, high] = line[i - 1].up < line[i].up ? [line[i - 1], line[i]] : [line[i], line[i - 1]];
      for (let level = Math.ceil(low.up / LEVEL_MM); level * LEVEL_MM <= high.up; ++level) {
        const share = high.up === low.up ? 0 : (level * LEVEL_MM - low.up) / (high.up - low.up);
        const forward = low.forward + share * (high.forward - low.forward);
        if (forward > (foremost.get(level) ?? -Infinity)) foremost.set(level, forward);
      }
    }
  }
  return Array.from(foremost, ([level, forward]) => ({ forward, up: level * LEVEL_MM })).sort((a, b) => b.up - a.up);
}
