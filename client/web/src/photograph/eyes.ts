// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type HeadFrame, toLps } from "../geometry/pose";
import { type Vector, add, norm, scaled, subtract } from "../geometry/rotation";
import type { Ball } from "./skin_fit";

const EYE_RADIUS_MM = 20;
/** From the outer corner to the middle of the lids. */
const TO_MIDDLE_MM = 14;
/** From the lower edge of the orbit up to the lids. */
const ABOVE_ORBIT_MM = 12;
/** From the tip of the nose, where nothing else is known. */
const FROM_NOSE = { forwardMm: -25, leftMm: 32, upMm: 38 };

/** Where lids may be open in the photograph and closed in the CT. `points`: landmarks on the CT by name, LPS. */
export function eyeBalls(points: ReadonlyMap<string, Vector>, frame: HeadFrame): Ball[] {
  return eyeMiddles(points, frame).map((middle) => ({ middle, radiusMm: EYE_RADIUS_MM }));
}

function eyeMiddles(points: ReadonlyMap<string, Vector>, frame: HeadFrame): Vector[] {
  const [left, right] = [points.get("exocanthion_left"), points.get("exocanthion_right")];
  if (left !== undefined && right !== undefined) {
    const inward = scaled(subtract(right, left), TO_MIDDLE_MM / norm(subtract(right, left)));
    return [add(left, inward), subtract(right, inward)];
  }
  const orbits = [points.get("orbitale_left"), points.get("orbitale_right")].flatMap((point) => (point === undefined ? [] : [point]));
  if (orbits.length === 2) return orbits.map((point) => add(point, toLps({ forwardMm: 0, leftMm: 0, upMm: ABOVE_ORBIT_MM }, frame)));
  const nose = points.get("pronasale");
  return nose === undefined ? [] : [1, -1].map((side) => add(nose, toLps({ ...FROM_NOSE, leftMm: side * FROM_NOSE.leftMm }, frame)));
}
