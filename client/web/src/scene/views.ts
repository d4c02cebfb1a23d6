// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import * as three from "three";

/** From where the stage is looked at, in its own axes: x left, y up, z forward. */
export const VIEWS = {
  front: { label: "Front", key: "1", from: [0, 0, 1] },
  left: { label: "Left", key: "2", from: [1, 0, 0] },
  right: { label: "Right", key: "3", from: [-1, 0, 0] },
  threeQuarter: { label: "3/4", key: "4", from: [0.72, 0.08, 1] },
  below: { label: "Below", key: "5", from: [0, -1, 0.35] },
} as const;

export type ViewName = keyof typeof VIEWS;

export function viewDirection(name: ViewName): three.Vector3 {
  return new three.Vector3(...VIEWS[name].from);
}

export interface EdgeLetters {
  left: string;
  right: string;
  top: string;
  bottom: string;
}

const DIRECTIONS: readonly [string, three.Vector3][] = [
  ["L", new three.Vector3(1, 0, 0)],
  ["R", new three.Vector3(-1, 0, 0)],
  ["S", new three.Vector3(0, 1, 0)],
  ["I", new three.Vector3(0, -1, 0)],
  ["A", new three.Vector3(0, 0, 1)],
  ["P", new three.Vector3(0, 0, -1)],
];

/** Which way of the patient lies nearest to each edge of the picture. */
export function edgeLetters(camera: three.Camera): EdgeLetters {
  const right = new three.Vector3(1, 0, 0).applyQuaternion(camera.quaternion);
  const up = new three.Vector3(0, 1, 0).applyQuaternion(camera.quaternion);
  const nearest = (to: three.Vector3) => DIRECTIONS.reduce((best, next) => (next[1].dot(to) > best[1].dot(to) ? next : best))[0];
  return { right: nearest(right), left: nearest(right.clone().negate()), top: nearest(up), bottom: nearest(up.clone().negate()) };
}

const NICE_MM = [1, 2, 5, 10, 20, 50, 100, 200, 500];
const LONGEST_BAR_PX = 160;

/** The longest bar of a round number of mm that fits. */
export function scaleBar(millimetresPerPixel: number): { mm: number; px: number } {
  const fitting = NICE_MM.filter((mm) => mm / millimetresPerPixel <= LONGEST_BAR_PX);
  const mm = fitting[fitting.length - 1] ?? NICE_MM[0];
  return { mm, px: mm / millimetresPerPixel };
}
