// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { SurfaceKind } from "../case/manifest";
import { type FacePoint } from "./face_point";

/** Which side of the midsagittal plane a landmark lies on. */
export type Side = "left" | "right" | "middle" | "any";

export interface FaceLandmark {
  /** As docs/measures.md and cases have it. */
  name: string;
  label: string;
  /** As surgeons write it on a profile. */
  short: string;
  kinds: readonly SurfaceKind[];
  side: Side;
  /** Where it is, for who places it. */
  hint: string;
}

const SKIN = ["skin"] as const;
const TEETH = ["teeth", "segment"] as const;
const BONE = ["segment", "bone"] as const;

/** All that measures know, from the forehead down. Definitions: docs/measures.md. */
export const FACE_LANDMARKS: readonly FaceLandmark[] = [
  { name: "soft_glabella", label: "Glabella", short: "G′", kinds: SKIN, side: "middle", hint: "the foremost point of the forehead between the brows" },
  { name: "pronasale", label: "Nose tip", short: "Prn", kinds: SKIN, side: "middle", hint: "the foremost point of the nose" },
  { name: "columella", label: "Columella", short: "Cm", kinds: SKIN, side: "middle", hint: "the foremost point of the lower border of the nose" },
  { name: "subnasale", label: "Subnasale", short: "Sn", kinds: SKIN, side: "middle", hint: "where the nose meets the upper lip" },
  { name: "labrale_superius", label: "Upper lip", short: "Ls", kinds: SKIN, side: "middle", hint: "the foremost point of the upper lip" },
  { name: "stomion_superius", label: "Upper stomion", short: "Sts", kinds: SKIN, side: "middle", hint: "the lowest point of the upper lip" },
  { name: "stomion_inferius", label: "Lower stomion", short: "Sti", kinds: SKIN, side: "middle", hint: "the highest point of the lower lip" },
  { name: "labrale_inferius", label: "Lower lip", short: "Li", kinds: SKIN, side: "middle", hint: "the foremost point of the lower lip" },
  { name: "sublabiale", label: "Mentolabial fold", short: "Sm", kinds: SKIN, side: "middle", hint: "the deepest point between lower lip and chin" },
  { name: "soft_pogonion", label: "Soft pogonion", short: "Pog′", kinds: SKIN, side: "middle", hint: "the foremost point of the chin" },
  { name: "soft_menton", label: "Soft menton", short: "Me′", kinds: SKIN, side: "middle", hint: "the lowest point of the chin" },
  { name: "upper_incisor", label: "Upper incisor", short: "U1", kinds: TEETH, side: "middle", hint: "the edge of an upper central incisor" },
  { name: "lower_incisor", label: "Lower incisor", short: "L1", kinds: TEETH, side: "middle", hint: "the edge of a lower central incisor" },
  { name: "upper_midline", label: "Upper dental midline", short: "UM", kinds: TEETH, side: "middle", hint: "between the upper central incisors" },
  { name: "lower_midline", label: "Lower dental midline", short: "LM", kinds: TEETH, side: "middle", hint: "between the lower central incisors" },
  { name: "upper_molar_left", label: "Upper molar, left", short: "U6l", kinds: TEETH, side: "left", hint: "a cusp of the patient's left upper first molar" },
  { name: "upper_molar_right", label: "Upper molar, right", short: "U6r", kinds: TEETH, side: "right", hint: "the same cusp of the right one" },
  { name: "pogonion", label: "Pogonion", short: "Pog", kinds: BONE, side: "middle", hint: "the foremost point of the bony chin" },
];

/** Further than this from the midsagittal plane lies no landmark of the middle. */
const MOST_OFF_MIDDLE_MM = 15;

/** Why this point cannot be the landmark, in a sentence; "" where it can. `isMiddleKnown`: where the midsagittal plane lies. */
export function sideProblem({ label, side }: FaceLandmark, { left }: FacePoint, isMiddleKnown: boolean): string {
  if (!isMiddleKnown) return "";
  if (side === "left" && left <= 0) return `${label}: this is the patient’s right side; choose a point on the left.`;
  if (side === "right" && left >= 0) return `${label}: this is the patient’s left side; choose a point on the right.`;
  if (side === "middle" && Math.abs(left) > MOST_OFF_MIDDLE_MM) {
    return `${label}: this is ${Math.abs(left).toFixed(0)} mm off the midsagittal plane; choose a point within ${MOST_OFF_MIDDLE_MM} mm of it.`;
  }
  return "";
}
