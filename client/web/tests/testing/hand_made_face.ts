// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { FacePoint } from "../../src/measures/face_point";

// A face of whole numbers, from which every measure is known by hand: left, forward and up, in mm. The figure of docs/measures.md
// is drawn from it.
//
// The E-line goes from (20, 0) to (-10, -40): its direction is (-3, -4) / 5, and (4, -3) / 5 points to its front.

export const HAND_MADE_FACE: ReadonlyMap<string, FacePoint> = new Map(
  Object.entries({
    soft_glabella: [0, 0, 50],
    pronasale: [0, 20, 0],
    columella: [0, 10, -10],
    subnasale: [0, 0, -10],
    labrale_superius: [0, 0, -20],
    stomion_superius: [0, -2, -22],
    stomion_inferius: [0, -2, -25],
    labrale_inferius: [0, -5, -30],
    sublabiale: [0, -15, -30],
    soft_pogonion: [0, -10, -40],
    soft_menton: [0, -20, -60],
    upper_incisor: [1, -8, -24],
    lower_incisor: [-1, -11, -22],
    upper_midline: [0.5, -8, -24],
    lower_midline: [-1.5, -11, -22],
    upper_molar_left: [20, -40, -22],
    upper_molar_right: [-20, -40, -20],
  }).map(([name, [left, forward, up]]) => [name, { left, forward, up }]),
);

const degrees = (radians: number) => (radians * 180) / Math.PI;

/** By hand, from the points above. */
export const ITS_MEASURES: Readonly<Record<string, number>> = {
  // ((0 - 20) * 4 + -20 * -3) / 5
  e_line_upper_lip: -4,
  // ((-5 - 20) * 4 + -30 * -3) / 5
  e_line_lower_lip: -2,
  // The columella goes straight forward, the lip straight down.
  nasolabial_angle: 90,
  // The lip goes straight forward, the chin goes 5 forward and 10 down.
  mentolabial_angle: degrees(Math.atan2(10, 5)),
  // The upper line goes straight down, the lower one 10 back on 30 down.
  facial_convexity: degrees(Math.atan2(10, 30)),
  lower_face_height: 50,
  interlabial_gap: 3,
  incisor_show: 2,
  overjet: 3,
  overbite: 2,
  upper_midline: 0.5,
  lower_midline: -1.5,
  chin_midline: 0,
  // The left lies 2 lower on 40.
  occlusal_cant: degrees(Math.atan2(2, 40)),
};
