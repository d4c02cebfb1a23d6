// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Vector } from "../geometry/rotation";

/** Three columns: the direction of each axis of the grid in LPS; unit length. */
export type Directions = readonly [Vector, Vector, Vector];

/** Where the voxels of a grid are. Voxel (i, j, k) has its center at origin + i spacing[0] directions[0] + j spacing[1] directions[1] + k spacing[2] directions[2]. */
export interface Grid {
  /** Voxels along i, j, k. */
  readonly size: readonly [number, number, number];
  /** Millimeters along i, j, k. */
  readonly spacing: Vector;
  /** LPS, millimeters: the center of the first voxel. */
  readonly origin: Vector;
  readonly directions: Directions;
}

/** A CT in the page, without anything that names the patient. */
export interface Volume {
  readonly grid: Grid;
  /** #i x #j x #k, i fastest: Hounsfield units, or gray values of a cone-beam CT. */
  readonly values: Int16Array;
  /** The reconstruction kernel as the scanner names it; empty where it is not known. */
  readonly kernel: string;
}

/** A label map on a grid of its own: for each voxel the number of a structure, 0 for none. */
export interface LabelMap {
  readonly grid: Grid;
  readonly values: Uint8Array | Uint16Array;
  /** Names of the numbers, where the file has some. */
  readonly names: ReadonlyMap<number, string>;
}
