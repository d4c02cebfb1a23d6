// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Grid } from "../volume/volume";
import type { Osteotomy, Plane } from "./recipe";

// Which bone a cut takes, as core/imaging/anatomy/osteotomy.cc says it: what lies on the positive side of every plane, and of that
// the largest connected piece. A build separates the jaws in the CT; here a label map does, or the occlusal plane.

/** Labels of bone; segments have 2, 3, .. in their order. */
export const FIXED_BONE = 1;
const FIRST_SEGMENT = 2;

/** Which jaw a voxel is of, where that is known. */
export const Jaw = { unknown: 0, lower: 1, upper: 2 } as const;

export interface PieceCut {
  readonly osteotomy: Osteotomy;
  readonly planes: readonly Plane[];
}

export interface BoneVoxels {
  readonly grid: Grid;
  /** Indices of the grid's voxels that are bone. */
  readonly indices: Uint32Array;
  /** LPS: 3 for each of them. */
  readonly places: Float32Array;
  /** Jaw of each of them. */
  readonly jaws: Uint8Array;
}

export interface Pieces {
  /** Label of each voxel of the grid. */
  readonly labels: Uint8Array;
  /** Of each segment. */
  readonly volumesMm3: readonly number[];
}

/** Heights over a plane whose normal has any length, in mm. */
export function heightOf({ point_mm, normal }: Plane): (places: Float32Array, at: number) => number {
  const length = Math.hypot(...normal);
  const [a, b, c] = normal.map((value) => value / length);
  const offset = a * point_mm[0] + b * point_mm[1] + c * point_mm[2];
  return (places, at) => a * places[at] + b * places[at + 1] + c * places[at + 2] - offset;
}

export function boneVoxels(grid: Grid, values: Float32Array, threshold: number, jaws: Uint8Array | null): BoneVoxels {
  const found: number[] = [];
  for (let at = 0; at < values.length; ++at) if (values[at] >= threshold) found.push(at);
  const places = new Float32Array(3 * found.length);
  const { origin, spacing, directions, size } = grid;
  found.forEach((at, index) => {
    const [i, j, k] = [at % size[0], Math.floor(at / size[0]) % size[1], Math.floor(at / (size[0] * size[1]))];
    for (let axis = 0; axis < 3; ++axis) {
      places[3 * index + axis] = origin[axis] + i * spacing[0] * directions[0][axis] + j * spacing[1] * directions[1][axis] + k * spacing[2] * directions[2][axis];
    }
  });
  return { grid, indices: Uint32Array.from(found), places, jaws: Uint8Array.from(found, (at) => jaws?.[at] ?? Jaw.unknown) };
}

/** `occlusal`: separates the jaws where no label does; null: nothing does. */
export function cutPieces(bone: BoneVoxels, cuts: readonly PieceCut[], occlusal: Plane | null): Pieces {
  const labels = new Uint8Array(bone.grid.size[0] * bone.grid.size[1] * bone.grid.size[2]);
  for (const at of bone.indices) labels[at] = FIXED_BONE;
  const mask = new Uint8Array(labels.length);
  for (const [number, cut] of cuts.entries()) {
    if (cut.planes.length === 0) continue;
    const inside = voxelsOf(bone, cut, occlusal);
    for (const at of inside) mask[at] = 1;
    for (const at of largestPiece(mask, inside, bone.grid.size)) labels[at] = FIRST_SEGMENT + number;
    for (const at of inside) mask[at] = 0;
  }
  const counts = cuts.map(() => 0);
  for (const at of bone.indices) if (labels[at] >= FIRST_SEGMENT) counts[labels[at] - FIRST_SEGMENT] += 1;
  const voxelMm3 = bone.grid.spacing[0] * bone.grid.spacing[1] * bone.grid.spacing[2];
  return { labels, volumesMm3: counts.map((count) => count * voxelMm3) };
}

function voxelsOf(bone: BoneVoxels, cut: PieceCut, occlusal: Plane | null): Uint32Array {
  const heights = cut.planes.map(heightOf);
  const overTeeth = occlusal === null ? null : heightOf(occlusal);
  const wanted = cut.osteotomy === "le_fort_1" ? Jaw.upper : Jaw.lower;
  const found = new Uint32Array(bone.indices.length);
  let count = 0;
  for (let index = 0, at = 0; index < bone.indices.length; ++index, at += 3) {
    if (!isWithin(heights, bone.places, at)) continue;
    const byPlane = overTeeth === null ? wanted : overTeeth(bone.places, at) < 0 ? Jaw.lower : Jaw.upper;
    if ((bone.jaws[index] === Jaw.unknown ? byPlane : bone.jaws[index]) === wanted) found[count++] = bone.indices[index];
  }
  return found.subarray(0, count);
}

function isWithin(heights: readonly ((places: Float32Array, at: number) => number)[], places: Float32Array, at: number): boolean {
  for (const height of heights) if (height(places, at) < 0) return false;
  return true;
}

/** Of the voxels that `mask` marks with 1, connected by faces; marks them with 2 on the way. */
function largestPiece(mask: Uint8Array, inside: Uint32Array, [nx, ny, nz]: readonly number[]): Uint32Array {
  const queue = new Uint32Array(inside.length);
  let [bestFrom, bestTo, end] = [0, 0, 0];
  const reach = (at: number) => {
    if (mask[at] !== 1) return;
    mask[at] = 2;
    queue[end++] = at;
  };
  for (const start of inside) {
    const from = end;
    reach(start);
    for (let next = from; next < end; ++next) {
      const at = queue[next];
      const [i, j, k] = [at % nx, Math.floor(at / nx) % ny, Math.floor(at / (nx * ny))];
      if (i > 0) reach(at - 1);
      if (i + 1 < nx) reach(at + 1);
      if (j > 0) reach(at - nx);
      if (j + 1 < ny) reach(at + nx);
      if (k > 0) reach(at - nx * ny);
      if (k + 1 < nz) reach(at + nx * ny);
    }
    if (end - from > bestTo - bestFrom) [bestFrom, bestTo] = [from, end];
  }
  return queue.subarray(bestFrom, bestTo);
}

/** How near the face of a cut comes to a structure. */
export interface NearCut {
  readonly segment: number;
  readonly structure: string;
  /** 0 where the cut passes through it. */
  readonly distanceMm: number;
}

/**
 * Structures that a cut comes nearer to than `marginMm`: of a plane counts only the part that the segment's other planes leave.
 * `voxelMm`: half of it is how far the middle of a structure's voxel may be from a plane that touches it.
 */
export function cutsNear(cuts: readonly PieceCut[], structures: ReadonlyMap<string, Float32Array>, marginMm: number, voxelMm: number): NearCut[] {
  const near: NearCut[] = [];
  cuts.forEach(({ planes }, segment) => {
    const heights = planes.map(heightOf);
    for (const [structure, places] of structures) {
      let distanceMm = Infinity;
      for (let at = 0; at < places.length; at += 3) {
        // From the surface of a convex piece: what is within is as far as the nearest plane, what is outside at least as far as from the plane that it is most beyond.
        let least = Infinity;
        for (const height of heights) least = Math.min(least, height(places, at));
        distanceMm = Math.min(distanceMm, Math.abs(least));
      }
      if (distanceMm <= marginMm) near.push({ segment, structure, distanceMm: distanceMm <= voxelMm / 2 ? 0 : distanceMm });
    }
  });
  return near;
}
