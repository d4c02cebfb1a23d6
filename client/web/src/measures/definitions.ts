// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type FacePoint, profileAngleDeg, profileDistanceMm } from "./face_point";

export type MeasureUnit = "mm" | "deg";

/** A published mean with its standard deviation where one was given. */
export interface Norm {
  mean: number;
  deviation: number | null;
  source: string;
}

/** A number of a face; `of` is given its landmarks in the order of `landmarks`. */
export interface MeasureDefinition {
  name: string;
  title: string;
  unit: MeasureUnit;
  landmarks: readonly string[];
  norm: Norm | null;
  /** It is a distance from the midsagittal plane. */
  isFromMiddle?: boolean;
  /** What is wrong with the points, in a sentence; null where they make a number. */
  problem: (points: readonly FacePoint[]) => string | null;
  of: (points: readonly FacePoint[]) => number;
}

const LEGAN = "Legan and Burstone 1980";
const RICKETTS = "Ricketts 1968";
/** Shorter arms of an angle do not count. */
const LEAST_ARM_MM = 1;
/** A nose tip that is less in front of chin and lip than this does not count. */
const LEAST_NOSE_MM = 3;

const fine = () => null;

/** From the nose tip to the chin; positive in front of it. */
function toEsthetic([nose, lip, chin]: readonly FacePoint[]): number {
  const [forward, up] = [chin.forward - nose.forward, chin.up - nose.up];
  // Down along the line its front is to the left.
  return (-up * (lip.forward - nose.forward) + forward * (lip.up - nose.up)) / Math.hypot(forward, up);
}

function noNose([nose, lip, chin]: readonly FacePoint[]): string | null {
  if (nose.up <= lip.up || lip.up <= chin.up) return "nose tip, lip and chin are not one below the other: check them";
  const isNose = nose.forward - Math.min(lip.forward, chin.forward) >= LEAST_NOSE_MM;
  return isNose ? null : "the profile has no nose in front of lip and chin: there is no E-line";
}

function shortArm([a, at, b]: readonly FacePoint[]): string | null {
  const isShort = profileDistanceMm(a, at) < LEAST_ARM_MM || profileDistanceMm(at, b) < LEAST_ARM_MM;
  return isShort ? "two of its landmarks coincide: check them" : null;
}

/** How far the lower line turns back from the upper one; positive: convex. */
function convexityDeg([glabella, subnasale, chin]: readonly FacePoint[]): number {
  return profileAngleDeg(glabella, subnasale, chin) - 180;
}

/** Of the line from the right to the left, seen from in front; positive: the left lies lower, as roll has it. */
function cantDeg([left, right]: readonly FacePoint[]): number {
  return (Math.atan2(right.up - left.up, left.left - right.left) * 180) / Math.PI;
}

function lip(name: string, title: string, landmark: string, mean: number): MeasureDefinition {
  const landmarks = ["pronasale", landmark, "soft_pogonion"];
  return { name, title, unit: "mm", landmarks, norm: { mean, deviation: null, source: RICKETTS }, problem: noNose, of: toEsthetic };
}

function vertical(name: string, title: string, upper: string, lower: string, norm: Norm | null = null): MeasureDefinition {
  return { name, title, unit: "mm", landmarks: [upper, lower], norm, problem: fine, of: ([a, b]) => a.up - b.up };
}

function midline(name: string, title: string, landmark: string): MeasureDefinition {
  return { name, title, unit: "mm", landmarks: [landmark], norm: null, isFromMiddle: true, problem: fine, of: ([point]) => point.left };
}

function profileAngle(name: string, title: string, landmarks: readonly string[], norm: Norm | null): MeasureDefinition {
  return { name, title, unit: "deg", landmarks, norm, problem: shortArm, of: ([a, at, b]) => profileAngleDeg(a, at, b) };
}

/** In the order in which they are shown; docs/measures.md has their definitions. */
export const MEASURES: readonly MeasureDefinition[] = [
  lip("e_line_upper_lip", "Upper lip to E-line", "labrale_superius", -4),
  lip("e_line_lower_lip", "Lower lip to E-line", "labrale_inferius", -2),
  profileAngle("nasolabial_angle", "Nasolabial angle", ["columella", "subnasale", "labrale_superius"], { mean: 102, deviation: 8, source: LEGAN }),
  profileAngle("mentolabial_angle", "Mentolabial angle", ["labrale_inferius", "sublabiale", "soft_pogonion"], null),
  {
    name: "facial_convexity",
    title: "Facial convexity",
    unit: "deg",
    landmarks: ["soft_glabella", "subnasale", "soft_pogonion"],
    norm: { mean: 12, deviation: 4, source: LEGAN },
    problem: shortArm,
    of: convexityDeg,
  },
  vertical("lower_face_height", "Lower face height", "subnasale", "soft_menton"),
  vertical("interlabial_gap", "Interlabial gap", "stomion_superius", "stomion_inferius", { mean: 2, deviation: 2, source: LEGAN }),
  vertical("incisor_show", "Upper incisor show", "stomion_superius", "upper_incisor", { mean: 2, deviation: 2, source: LEGAN }),
  {
    name: "overjet",
    title: "Overjet",
    unit: "mm",
    landmarks: ["upper_incisor", "lower_incisor"],
    norm: null,
    problem: fine,
    of: ([upper, lower]) => upper.forward - lower.forward,
  },
  vertical("overbite", "Overbite", "lower_incisor", "upper_incisor"),
  midline("upper_midline", "Upper dental midline", "upper_midline"),
  midline("lower_midline", "Lower dental midline", "lower_midline"),
  midline("chin_midline", "Chin midline", "soft_pogonion"),
  {
    name: "occlusal_cant",
    title: "Cant of the occlusal plane",
    unit: "deg",
    landmarks: ["upper_molar_left", "upper_molar_right"],
    norm: null,
    problem: ([left, right]) => (left.left - right.left < LEAST_ARM_MM ? "left and right molar coincide or are swapped: check them" : null),
    of: cantDeg,
  },
];
