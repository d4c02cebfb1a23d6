// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { CaseFile } from "../case/case_file";
import type { Pose } from "../geometry/pose";
import type { Vector } from "../geometry/rotation";
import type { Anchor } from "./anchor";

/** Of each set of poses where these vertices of the case's list are, three numbers each in mm; null where that is not known. */
export type PlacesAt = (poseSets: readonly (readonly Pose[])[], vertices: Int32Array) => Promise<Float32Array | null>;

/** An entry of the case's list by which a point moves, and by how much. */
interface Part {
  vertex: number;
  weight: number;
}

/**
 * Where points of the skin are under each set of poses, LPS: only what they move by is asked for. `rest`: of the case's list, #list
 * by 3. Null where `placesAt` does not know.
 */
export async function skinPointsAt(file: CaseFile, rest: Float32Array, placesAt: PlacesAt, poseSets: readonly (readonly Pose[])[], anchors: readonly Anchor[]): Promise<Vector[][] | null> {
  const points = anchors.map((anchor) => ({ atRest: restOf(file, anchor), parts: partsOf(file, anchor) }));
  const vertices = Int32Array.from(new Set(points.flatMap(({ parts }) => parts.map(({ vertex }) => vertex)))).sort();
  const places = await placesAt(poseSets, vertices);
  if (places === null) return null;
  const numberOf = new Map(Array.from(vertices, (vertex, number) => [vertex, number]));
  return poseSets.map((_, set) => {
    const first = set * vertices.length;
    const moved = (vertex: number, axis: number) => places[3 * (first + (numberOf.get(vertex) as number)) + axis] - rest[3 * vertex + axis];
    return points.map(({ atRest, parts }) => atRest.map((at, axis) => parts.reduce((sum, { vertex, weight }) => sum + weight * moved(vertex, axis), at)) as Vector);
  });
}

function cornersOf(file: CaseFile, { surface, triangle, weights }: Anchor): { corner: number; weight: number }[] {
  const { triangles } = file.surfaces[surface];
  return weights.map((weight, k) => ({ corner: triangles[3 * triangle + k], weight }));
}

function restOf(file: CaseFile, anchor: Anchor): Vector {
  const { positions } = file.surfaces[anchor.surface];
  return [0, 1, 2].map((axis) => cornersOf(file, anchor).reduce((sum, { corner, weight }) => sum + weight * positions[3 * corner + axis], 0)) as Vector;
}

function partsOf(file: CaseFile, anchor: Anchor): Part[] {
  const { follows } = file.surfaces[anchor.surface];
  if (follows === null) return [];
  return cornersOf(file, anchor).flatMap(({ corner, weight }) =>
    [0, 1, 2].flatMap((k): Part[] => {
      const at = 3 * corner + k;
      return follows.weights[at] === 0 || weight === 0 ? [] : [{ vertex: follows.places[at], weight: weight * follows.weights[at] }];
    }),
  );
}
