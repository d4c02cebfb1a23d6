// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { FacePoints } from "./face_point";
import type { ProfilePoint } from "./profile";

/** Below the nose tip, above the brows: so far up the forehead is looked at. */
const FOREHEAD_MM: readonly [number, number] = [35, 75];
/** The chin's lower border lies within so many mm below its foremost point. */
const CHIN_MM = 30;

/**
 * Points of the profile that cases do not name, found from those that they do, by name: the foremost of the forehead, the deepest
 * of the mentolabial fold, the upper lip where it ends, the lower border of nose and chin. `profile`: outline at rest, from the top down.
 */
export function suggestFromProfile(profile: readonly ProfilePoint[], known: FacePoints): Map<string, ProfilePoint> {
  const found = new Map<string, ProfilePoint>();
  const add = (name: string, point: ProfilePoint | null) => point !== null && found.set(name, point);
  const [nose, subnasale] = [known.get("pronasale"), known.get("subnasale")];
  const [upper, lower, chin] = [known.get("labrale_superius"), known.get("labrale_inferius"), known.get("soft_pogonion")];
  if (nose !== undefined) add("soft_glabella", foremost(between(profile, nose.up + FOREHEAD_MM[1], nose.up + FOREHEAD_MM[0])));
  if (nose !== undefined && subnasale !== undefined) add("columella", columella(between(profile, nose.up, subnasale.up), nose, subnasale));
  if (upper !== undefined && lower !== undefined) {
    // Not the lower one: where the skin is closed between the lips both would lie on each other, and their gap be none for ever.
    add("stomion_superius", deepest(between(profile, upper.up, lower.up), upper, lower));
  }
  if (lower !== undefined && chin !== undefined) add("sublabiale", deepest(between(profile, lower.up, chin.up), lower, chin));
  if (chin !== undefined) add("soft_menton", lowestOfChin(between(profile, chin.up, chin.up - CHIN_MM), chin));
  return found;
}

function between(profile: readonly ProfilePoint[], high: number, low: number): ProfilePoint[] {
  return profile.filter(({ up }) => up <= high && up >= low);
}

function best(points: readonly ProfilePoint[], score: (point: ProfilePoint) => number): ProfilePoint | null {
  let chosen: ProfilePoint | null = null;
  for (const point of points) if (chosen === null || score(point) > score(chosen)) chosen = point;
  return chosen;
}

function foremost(points: readonly ProfilePoint[]): ProfilePoint | null {
  return best(points, ({ forward }) => forward);
}

/** Furthest behind the line between two points; null where nothing is. */
function deepest(points: readonly ProfilePoint[], a: ProfilePoint, b: ProfilePoint): ProfilePoint | null {
  const height = (point: ProfilePoint) => (b.up - a.up) * (point.forward - a.forward) - (b.forward - a.forward) * (point.up - a.up);
  const point = best(points, height);
  return point === null || height(point) <= 0 ? null : point;
}

/** Where the lower border of the nose, straight from subnasale, turns up to the tip: furthest out of the line between both. */
function columella(points: readonly ProfilePoint[], nose: ProfilePoint, subnasale: ProfilePoint): ProfilePoint | null {
  const height = (point: ProfilePoint) =>
    (subnasale.forward - nose.forward) * (point.up - nose.up) - (subnasale.up - nose.up) * (point.forward - nose.forward);
  const point = best(points, height);
  return point === null || height(point) <= 0 ? null : point;
}

/** Where the chin's outline turns back below: the throat falls away less steeply than it goes back. */
function lowestOfChin(points: readonly ProfilePoint[], chin: ProfilePoint): ProfilePoint | null {
  return best(points, ({ forward, up }) => 0.5 * (forward - chin.forward) - (up - chin.up));
}
