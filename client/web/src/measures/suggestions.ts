// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { FacePoints } from "./face_point";
import type { ProfilePoint } from "./profile";

/** The root of the nose lies so far above its tip at least; so far up the forehead above it is looked for. */
const ROOT_MM = 25;
const FOREHEAD_MM = 75;
/** The forehead stands out of the root of the nose by so much at least; less is a hump of the nose's back, or no forehead. */
const LEAST_BROW_MM = 1;
/** A shallower mentolabial fold does not count: the angle at it would only measure the noise of the skin. */
const LEAST_FOLD_MM = 1;
/** The chin's lower border lies within so many mm below its foremost point. */
const CHIN_MM = 30;

/**
 * Points of the profile that cases do not name, found from those that they do, by name: the foremost of the forehead, the deepest
 * of the mentolabial fold, the upper lip where it ends, the lower border of nose and chin. Where the profile has no such point none
 * is suggested. `profile`: outline at rest, from the top down.
 */
export function suggestFromProfile(profile: readonly ProfilePoint[], known: FacePoints): Map<string, ProfilePoint> {
  const found = new Map<string, ProfilePoint>();
  const add = (name: string, point: ProfilePoint | null) => point !== null && found.set(name, point);
  const [nose, subnasale] = [known.get("pronasale"), known.get("subnasale")];
  const [upper, lower, chin] = [known.get("labrale_superius"), known.get("labrale_inferius"), known.get("soft_pogonion")];
  if (nose !== undefined) add("soft_glabella", glabella(between(profile, nose.up + FOREHEAD_MM, nose.up), nose.up + ROOT_MM));
  if (nose !== undefined && subnasale !== undefined) add("columella", columella(between(profile, nose.up, subnasale.up), nose, subnasale));
  if (upper !== undefined && lower !== undefined) {
    // Not the lower one: where the skin is closed between the lips both would coincide, and their gap always be 0.
    add("stomion_superius", deepest(between(profile, upper.up, lower.up), upper, lower));
  }
  if (lower !== undefined && chin !== undefined) add("sublabiale", deepest(between(profile, lower.up, chin.up), lower, chin, LEAST_FOLD_MM));
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

/**
 * The foremost above the root of the nose, which is the deepest between both. Null where that lies too near the tip, and where the
 * foremost is the last of the points: there the profile goes on, as on a forehead that falls back and where a CT is cut off.
 */
function glabella(points: readonly ProfilePoint[], leastRootUp: number): ProfilePoint | null {
  const upwards = Array.from(points).sort((a, b) => a.up - b.up);
  let root = 0;
  const rise = upwards.findIndex(({ forward }, i) => {
    if (forward < upwards[root].forward) root = i;
    return forward >= upwards[root].forward + LEAST_BROW_MM;
  });
  if (rise < 0 || upwards[root].up < leastRootUp) return null;
  const brow = best(upwards.slice(rise), ({ forward }) => forward);
  return brow === upwards[upwards.length - 1] ? null : brow;
}

/** Furthest behind the line between two points; null where nothing is, or nothing by so much. */
function deepest(points: readonly ProfilePoint[], a: ProfilePoint, b: ProfilePoint, leastMm = 0): ProfilePoint | null {
  const [forward, up] = [b.forward - a.forward, b.up - a.up];
  const depthMm = (point: ProfilePoint) => (up * (point.forward - a.forward) - forward * (point.up - a.up)) / Math.hypot(forward, up);
  const point = best(points, depthMm);
  return point === null || depthMm(point) <= leastMm ? null : point;
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
