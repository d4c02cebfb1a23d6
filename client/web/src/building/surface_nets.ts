// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Grid } from "../volume/volume";
import { placeOf } from "./bone_grid";

/** A threshold surface. */
export interface NetSurface {
  /** LPS, mm: 3 for each vertex. */
  readonly positions: Float32Array;
  /** Counter-clockwise from outside. */
  readonly triangles: Uint32Array;
  /** Of each vertex: a voxel next to it that is above the threshold. */
  readonly voxels: Uint32Array;
}

const CORNERS = [0, 1, 2, 3, 4, 5, 6, 7].map((corner) => [corner & 1, (corner >> 1) & 1, corner >> 2] as const);
const EDGES = CORNERS.flatMap((_, corner) => [1, 2, 4].filter((bit) => (corner & bit) === 0).map((bit) => [corner, corner | bit] as const));

/**
 * Naive surface nets (Gibson 1998): one vertex in each cell of eight voxels that the threshold crosses, at the mean of the
 * crossings, and four-sided faces between the cells around each edge that it crosses. A surface that meets the border of the grid
 * is open there.
 */
export function surfaceNets(grid: Grid, values: Float32Array, threshold: number): NetSurface {
  const [nx, ny, nz] = grid.size;
  const strides = [1, nx, nx * ny];
  const vertexOf = new Int32Array(values.length).fill(-1);
  const positions: number[] = [];
  const voxels: number[] = [];
  const steps = CORNERS.map(([i, j, k]) => i * strides[0] + j * strides[1] + k * strides[2]);

  const addVertex = (i: number, j: number, k: number, cell: number, isAbove: number) => {
    let [x, y, z, count] = [0, 0, 0, 0];
    for (const [a, b] of EDGES) {
      if (((isAbove >> a) & 1) === ((isAbove >> b) & 1)) continue;
      const [low, high] = [values[cell + steps[a]], values[cell + steps[b]]];
      const share = (threshold - low) / (high - low);
      x += CORNERS[a][0] + share * (CORNERS[b][0] - CORNERS[a][0]);
      y += CORNERS[a][1] + share * (CORNERS[b][1] - CORNERS[a][1]);
      z += CORNERS[a][2] + share * (CORNERS[b][2] - CORNERS[a][2]);
      count += 1;
    }
    vertexOf[cell] = voxels.length;
    positions.push(...placeOf(grid, i + x / count, j + y / count, k + z / count));
    voxels.push(cell + steps[CORNERS.findIndex((_, corner) => ((isAbove >> corner) & 1) === 1)]);
  };
  for (let k = 0; k + 1 < nz; ++k) {
    for (let j = 0; j + 1 < ny; ++j) {
      for (let i = 0, cell = k * strides[2] + j * nx; i + 1 < nx; ++i, ++cell) {
        let isAbove = 0;
        for (let corner = 0; corner < 8; ++corner) if (values[cell + steps[corner]] >= threshold) isAbove |= 1 << corner;
        if (isAbove !== 0 && isAbove !== 255) addVertex(i, j, k, cell, isAbove);
      }
    }
  }
  return { positions: Float32Array.from(positions), triangles: facesOf(grid, values, threshold, vertexOf, strides), voxels: Uint32Array.from(voxels) };
}

/** Around each edge of voxels that the threshold crosses lie four cells. */
function facesOf({ size, directions }: Grid, values: Float32Array, threshold: number, vertexOf: Int32Array, strides: readonly number[]): Uint32Array {
  const triangles: number[] = [];
  const [a, b, c] = directions;
  const turn = a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0]);
  for (let k = 0; k < size[2]; ++k) {
    for (let j = 0; j < size[1]; ++j) {
      for (let i = 0; i < size[0]; ++i) {
        const at = i + j * strides[1] + k * strides[2];
        const index = [i, j, k];
        const isIn = values[at] >= threshold;
        for (let axis = 0; axis < 3; ++axis) {
          const [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
          if (index[axis] + 1 >= size[axis] || index[u] === 0 || index[v] === 0 || isIn === values[at + strides[axis]] >= threshold) continue;
          const four = [at, at - strides[u], at - strides[u] - strides[v], at - strides[v]].map((cell) => vertexOf[cell]);
          if (four.includes(-1)) continue;
          const [p, q, r, s] = isIn === turn > 0 ? four : four.reverse();
          triangles.push(p, q, r, p, r, s);
        }
      }
    }
  }
  return Uint32Array.from(triangles);
}
