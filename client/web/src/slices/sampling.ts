// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type Vector, cross, dot, scaled, subtract } from "../geometry/rotation";
import type { Grid, LabelMap, Volume } from "../volume/volume";

/** The value of a pixel outside the grid. No CT has it. */
export const OUTSIDE = -32768;

/** Pixels in space: pixel (x, y) has its center at origin + x right + y down. */
export interface Patch {
  /** LPS, millimeters: the center of the first pixel. */
  readonly origin: Vector;
  /** LPS, millimeters: from a pixel to the next one. */
  readonly right: Vector;
  readonly down: Vector;
  readonly width: number;
  readonly height: number;
}

/** Turns LPS into the indices of a grid, whose axes need not be at right angles. */
export class GridIndex {
  private readonly rows: readonly Vector[];

  constructor(private readonly grid: Grid) {
    const [a, b, c] = grid.directions;
    const determinant = dot(a, cross(b, c));
    this.rows = [cross(b, c), cross(c, a), cross(a, b)].map((row, axis) => scaled(row, 1 / (determinant * grid.spacing[axis])));
  }

  /** Of a point: 0, 0, 0 is the center of the first voxel. */
  ofPoint(point: Vector): Vector {
    return this.ofVector(subtract(point, this.grid.origin));
  }

  ofVector(vector: Vector): Vector {
    return [dot(this.rows[0], vector), dot(this.rows[1], vector), dot(this.rows[2], vector)];
  }
}

/** The pixels of a row from `first` to before `last` whose index is in the grid: a voxel extends half a voxel around its center. */
export function insideRange(start: Vector, step: Vector, size: readonly number[], width: number): [first: number, last: number] {
  let [first, last] = [0, width - 1];
  for (let axis = 0; axis < 3; ++axis) {
    const [low, high] = [-0.5 - start[axis], size[axis] - 0.5 - start[axis]];
    if (Math.abs(step[axis]) < 1e-12) {
      if (low > 0 || high < 0) return [0, 0];
      continue;
    }
    const [a, b] = [low / step[axis], high / step[axis]];
    first = Math.max(first, Math.ceil(Math.min(a, b) - 1e-9));
    last = Math.min(last, Math.floor(Math.max(a, b) + 1e-9));
  }
  return first > last ? [0, 0] : [first, last + 1];
}

/** Trilinear values of the pixels of a patch, rounded; OUTSIDE where the grid has none. `out`: at least width x height. */
export function sampleVolume({ grid, values }: Volume, patch: Patch, out: Int16Array): void {
  const index = new GridIndex(grid);
  const [start, step, next] = [index.ofPoint(patch.origin), index.ofVector(patch.right), index.ofVector(patch.down)];
  for (let y = 0; y < patch.height; ++y) {
    const begin: Vector = [start[0] + y * next[0], start[1] + y * next[1], start[2] + y * next[2]];
    sampleRow(values, grid.size, begin, step, out.subarray(y * patch.width, (y + 1) * patch.width));
  }
}

function sampleRow(values: Int16Array, size: readonly [number, number, number], start: Vector, step: Vector, out: Int16Array): void {
  const [mx, my, mz] = [size[0] - 1, size[1] - 1, size[2] - 1];
  const [tx, ty, tz] = [Math.max(0, mx - 1), Math.max(0, my - 1), Math.max(0, mz - 1)];
  // An axis of one voxel has no neighbor: its step stays in place.
  const sx = mx > 0 ? 1 : 0, sy = my > 0 ? size[0] : 0, sz = mz > 0 ? size[0] * size[1] : 0;
  const strideY = size[0], strideZ = size[0] * size[1];
  const [first, last] = insideRange(start, step, size, out.length);
  out.fill(OUTSIDE, 0, first);
  out.fill(OUTSIDE, last);
  for (let pixel = first; pixel < last; ++pixel) {
    let x = start[0] + pixel * step[0], y = start[1] + pixel * step[1], z = start[2] + pixel * step[2];
    x = x < 0 ? 0 : x > mx ? mx : x;
    y = y < 0 ? 0 : y > my ? my : y;
    z = z < 0 ? 0 : z > mz ? mz : z;
    let i = x | 0, j = y | 0, k = z | 0;
    if (i > tx) i = tx;
    if (j > ty) j = ty;
    if (k > tz) k = tz;
    const u = x - i, v = y - j, w = z - k;
    const at = i + j * strideY + k * strideZ;
    const a = values[at] + u * (values[at + sx] - values[at]);
    const b = values[at + sy] + u * (values[at + sx + sy] - values[at + sy]);
    const c = values[at + sz] + u * (values[at + sx + sz] - values[at + sz]);
    const d = values[at + sy + sz] + u * (values[at + sx + sy + sz] - values[at + sy + sz]);
    const near = a + v * (b - a);
    out[pixel] = Math.floor(near + w * (c + v * (d - c) - near) + 0.5);
  }
}

/** The label of the nearest voxel of each pixel; 0 outside. `out`: at least width x height. */
export function sampleLabels({ grid, values }: LabelMap, patch: Patch, out: Uint16Array): void {
  const index = new GridIndex(grid);
  const [start, step, next] = [index.ofPoint(patch.origin), index.ofVector(patch.right), index.ofVector(patch.down)];
  const [nx, ny, nz] = grid.size;
  for (let row = 0; row < patch.height; ++row) {
    const begin: Vector = [start[0] + row * next[0], start[1] + row * next[1], start[2] + row * next[2]];
    const [first, last] = insideRange(begin, step, grid.size, patch.width);
    const at = row * patch.width;
    out.fill(0, at, at + patch.width);
    for (let pixel = first; pixel < last; ++pixel) {
      const i = nearest(begin[0] + pixel * step[0], nx), j = nearest(begin[1] + pixel * step[1], ny), k = nearest(begin[2] + pixel * step[2], nz);
      out[at + pixel] = values[i + nx * (j + ny * k)];
    }
  }
}

function nearest(index: number, count: number): number {
  return Math.max(0, Math.min(count - 1, Math.floor(index + 0.5)));
}
