// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { CaseFile, CaseSurface } from "../case/case_file";
import { pointAt } from "../geometry/rigid_fit";
import { type Vector, add, scaled } from "../geometry/rotation";
import type { Anchor } from "../measures/anchor";

/** Where a target is on the tet mesh's skin, which the server knows, and on the one that is drawn. */
export interface TargetPlace {
  /** On the mesh at rest. */
  pointMm: Vector;
  /** Of the mesh: the mean of these is meant; null: `pointMm`. */
  vertices: number[] | null;
  /** By which part of the mesh's movement the drawn skin goes there, over 0 up to 1. */
  share: number;
  /** Of the drawn skin, at rest. */
  drawnMm: Vector;
  /** It goes by the sum of what these places of CaseFile.followed do, each times its weight. */
  follows: readonly (readonly [place: number, weight: number])[];
}

/** Skin that follows less than this is beyond what is modelled. */
const LEAST_SHARE = 0.2;
/** More vertices of a region add no information. */
const MOST_VERTICES = 2000;

/** At the vertex of the skin that is nearest to the anchor; null where the skin does not move. */
export function placeOfAnchor(file: CaseFile, { surface, triangle, weights }: Anchor): TargetPlace | null {
  const skin = file.surfaces[surface];
  const corner = weights.indexOf(Math.max(...weights));
  const vertex = skin.triangles[3 * triangle + corner];
  const share = shareOf(skin, vertex);
  if (skin.follows === null || share < LEAST_SHARE) return null;
  let pointMm: Vector = [0, 0, 0];
  for (let k = 0; k < 3; ++k) {
    const followed = file.followed[skin.follows.places[3 * vertex + k]];
    pointMm = add(pointMm, scaled(pointAt(file.restPositions, followed), skin.follows.weights[3 * vertex + k] / share));
  }
  const { places, weights: shares } = skin.follows;
  const follows = [0, 1, 2].map((k) => [places[3 * vertex + k], shares[3 * vertex + k]] as const);
  return { pointMm, vertices: null, share, drawnMm: pointAt(skin.positions, vertex), follows };
}

/** A named region of the skin; null where nothing of it moves. */
export function placeOfRegion(file: CaseFile, region: number): TargetPlace | null {
  const skin = file.surfaces.find(({ entry, regions }) => entry.kind === "skin" && regions !== null);
  if (skin?.regions == null || skin.follows === null) return null;
  const found = new Set<number>();
  let [share, count] = [0, 0];
  let drawnMm: Vector = [0, 0, 0];
  for (let vertex = 0; vertex < skin.positions.length / 3; ++vertex) {
    const own = shareOf(skin, vertex);
    if (skin.regions[vertex] !== region || own < LEAST_SHARE) continue;
    const row = [0, 1, 2].map((k) => (skin.follows as NonNullable<typeof skin.follows>).weights[3 * vertex + k]);
    found.add(skin.follows.places[3 * vertex + row.indexOf(Math.max(...row))]);
    drawnMm = add(drawnMm, pointAt(skin.positions, vertex));
    share += own;
    count += 1;
  }
  if (count === 0) return null;
  const all = Array.from(found);
  const places = all.filter((_, index) => index % Math.ceil(all.length / MOST_VERTICES) === 0);
  const middle = scaled(drawnMm, 1 / count);
  const follows = places.map((place) => [place, share / count / places.length] as const);
  return { pointMm: middle, vertices: places.map((place) => file.followed[place]), share: share / count, drawnMm: middle, follows };
}

/** How far the drawn skin is from rest there, LPS. `displacements`: three of each of CaseFile.followed, mm. */
export function shownMove({ follows }: TargetPlace, displacements: Float32Array): Vector {
  return follows.reduce<Vector>((sum, [place, weight]) => add(sum, scaled(pointAt(displacements, place), weight)), [0, 0, 0]);
}

function shareOf({ follows }: CaseSurface, vertex: number): number {
  return follows === null ? 0 : follows.weights[3 * vertex] + follows.weights[3 * vertex + 1] + follows.weights[3 * vertex + 2];
}
