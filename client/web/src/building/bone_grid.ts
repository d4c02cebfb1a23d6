// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type Vector, add, scaled } from "../geometry/rotation";
import type { Grid, LabelMap, Volume } from "../volume/volume";

// A CT at the resolution of a preview. The page keeps the volume where it is: a copy of it for a worker would double its memory.

/** Edges of the preview's voxels, about. */
export const PREVIEW_MM = 1.5;
/** The page draws between slabs of the volume. */
const PAUSE_MS = 12;

export interface ReducedVolume {
  readonly grid: Grid;
  /** Means of blocks of the volume's values. */
  readonly values: Float32Array;
}

/** LPS of the middle of voxel (i, j, k), which may lie between voxels. */
export function placeOf({ origin, spacing, directions }: Grid, i: number, j: number, k: number): Vector {
  return add(origin, add(scaled(directions[0], i * spacing[0]), add(scaled(directions[1], j * spacing[1]), scaled(directions[2], k * spacing[2]))));
}

/** How many voxels of `grid` make one of the preview along each axis. */
export function blockOf({ spacing, size }: Grid, previewMm: number): [number, number, number] {
  return spacing.map((mm, axis) => Math.max(1, Math.min(size[axis], Math.round(previewMm / mm)))) as [number, number, number];
}

/** In slabs, with pauses in which the page answers. Rejects with the reason of `signal`. */
export async function reduceVolume(volume: Volume, previewMm = PREVIEW_MM, signal?: AbortSignal): Promise<ReducedVolume> {
  const { grid, values } = volume;
  const block = blockOf(grid, previewMm);
  const size = grid.size.map((count, axis) => Math.floor(count / block[axis])) as [number, number, number];
  const spacing = grid.spacing.map((mm, axis) => mm * block[axis]) as Vector;
  const origin = placeOf(grid, (block[0] - 1) / 2, (block[1] - 1) / 2, (block[2] - 1) / 2);
  const reduced = new Float32Array(size[0] * size[1] * size[2]);
  let paused = performance.now();
  for (let k = 0; k < size[2] * block[2]; ++k) {
    addSlice(values, grid.size, k, block, size, reduced);
    if (performance.now() - paused < PAUSE_MS) continue;
    await new Promise((resolve) => setTimeout(resolve));
    signal?.throwIfAborted();
    paused = performance.now();
  }
  const share = 1 / (block[0] * block[1] * block[2]);
  for (let i = 0; i < reduced.length; ++i) reduced[i] *= share;
  return { grid: { size, spacing, origin, directions: grid.directions }, values: reduced };
}

function addSlice(values: Int16Array, [width, height]: readonly number[], k: number, block: readonly number[], size: readonly number[], sums: Float32Array): void {
  for (let j = 0; j < size[1] * block[1]; ++j) {
    let from = (k * height + j) * width;
    const to = (Math.floor(k / block[2]) * size[1] + Math.floor(j / block[1])) * size[0];
    for (let i = 0; i < size[0]; ++i) {
      for (let step = 0; step < block[0]; ++step) sums[to + i] += values[from++];
    }
  }
}

/** What a label map says of the voxels of `grid`: `codes` of the numbers that it has, 0 elsewhere. */
export function resampleLabels(labels: LabelMap, codes: ReadonlyMap<number, number>, grid: Grid): Uint8Array {
  const out = new Uint8Array(grid.size[0] * grid.size[1] * grid.size[2]);
  const toIndex = indexOf(labels.grid);
  const start = toIndex(grid.origin);
  const steps = grid.directions.map((direction, axis) => {
    const moved = toIndex(add(grid.origin, scaled(direction, grid.spacing[axis])));
    return moved.map((value, at) => value - start[at]);
  });
  const [nx, ny, nz] = labels.grid.size;
  let at = 0;
  for (let k = 0; k < grid.size[2]; ++k) {
    for (let j = 0; j < grid.size[1]; ++j) {
      for (let i = 0; i < grid.size[0]; ++i, ++at) {
        const x = Math.round(start[0] + i * steps[0][0] + j * steps[1][0] + k * steps[2][0]);
        const y = Math.round(start[1] + i * steps[0][1] + j * steps[1][1] + k * steps[2][1]);
        const z = Math.round(start[2] + i * steps[0][2] + j * steps[1][2] + k * steps[2][2]);
        if (x < 0 || y < 0 || z < 0 || x >= nx || y >= ny || z >= nz) continue;
        out[at] = codes.get(labels.values[(z * ny + y) * nx + x]) ?? 0;
      }
    }
  }
  return out;
}

/** From LPS to indices of voxels with parts; the directions are at right angles. */
function indexOf({ origin, spacing, directions }: Grid): (point: Vector) => Vector {
  return (point) =>
    directions.map((direction, axis) => {
      const along = direction[0] * (point[0] - origin[0]) + direction[1] * (point[1] - origin[1]) + direction[2] * (point[2] - origin[2]);
      return along / spacing[axis];
    }) as Vector;
}

/** Middles of the voxels that have one of these numbers, at most about `most` of them, evenly left out. */
export function placesOf(labels: LabelMap, numbers: ReadonlySet<number>, most: number): Float32Array {
  const found: number[] = [];
  const { size } = labels.grid;
  for (let at = 0; at < labels.values.length; ++at) if (labels.values[at] !== 0 && numbers.has(labels.values[at])) found.push(at);
  const step = Math.max(1, Math.ceil(found.length / most));
  const places: number[] = [];
  for (let index = 0; index < found.length; index += step) {
    const at = found[index];
    places.push(...placeOf(labels.grid, at % size[0], Math.floor(at / size[0]) % size[1], Math.floor(at / (size[0] * size[1]))));
  }
  return Float32Array.from(places);
}
