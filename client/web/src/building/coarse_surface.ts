// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { NetSurface } from "./surface_nets";

/**
 * About `most` triangles in place of all of a surface: in each block of the grid's voxels one vertex stands for those that are joined
 * there, so that two walls of thin bone stay apart. They index the same vertices: colors and normals serve both.
 */
export function coarserTriangles(surface: NetSurface, size: readonly [number, number, number], most: number): Uint32Array {
  const { triangles, positions } = surface;
  // Triangles grow fewer with the square of the edge.
  const edge = Math.ceil(Math.sqrt(triangles.length / 3 / most));
  if (edge <= 1) return triangles;
  const middles = middlesOf(positions, joinedWithin(blocksOf(surface, size, edge), triangles));
  const coarse: number[] = [];
  for (let at = 0; at < triangles.length; at += 3) {
    const [a, b, c] = [middles[triangles[at]], middles[triangles[at + 1]], middles[triangles[at + 2]]];
    if (a !== b && b !== c && c !== a) coarse.push(a, b, c);
  }
  return Uint32Array.from(coarse);
}

/** Of each vertex: a number of the block of `edge` voxels along each axis that it is in. */
function blocksOf({ voxels }: NetSurface, [nx, ny]: readonly number[], edge: number): Uint32Array {
  return voxels.map((at) => {
    const [i, j, k] = [at % nx, Math.floor(at / nx) % ny, Math.floor(at / (nx * ny))].map((index) => Math.floor(index / edge));
    return (k * ny + j) * nx + i;
  });
}

/** Of each vertex: one of those that triangles join to it within its block, the same for all of them. */
function joinedWithin(blocks: Uint32Array, triangles: Uint32Array): Uint32Array {
  const parents = blocks.map((_, vertex) => vertex);
  const rootOf = (vertex: number) => {
    while (parents[vertex] !== vertex) vertex = parents[vertex] = parents[parents[vertex]];
    return vertex;
  };
  triangles.forEach((a, at) => {
    const b = triangles[at % 3 === 2 ? at - 2 : at + 1];
    if (blocks[a] === blocks[b]) parents[rootOf(a)] = rootOf(b);
  });
  return parents.map((_, vertex) => rootOf(vertex));
}

/** Of each vertex: that of its group which is nearest to the mean of them. */
function middlesOf(positions: Float32Array, groups: Uint32Array): Uint32Array {
  const sums = new Float64Array(positions.length);
  const counts = new Uint32Array(groups.length);
  groups.forEach((group, vertex) => {
    counts[group] += 1;
    for (let axis = 0; axis < 3; ++axis) sums[3 * group + axis] += positions[3 * vertex + axis];
  });
  const middles = groups.slice();
  const nearest = new Float64Array(groups.length).fill(Infinity);
  groups.forEach((group, vertex) => {
    const far = Math.hypot(...[0, 1, 2].map((axis) => positions[3 * vertex + axis] - sums[3 * group + axis] / counts[group]));
    if (far < nearest[group]) [nearest[group], middles[group]] = [far, vertex];
  });
  return groups.map((group) => middles[group]);
}
