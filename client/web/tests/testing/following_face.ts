// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type CaseFile, openCase } from "../../src/case/case_file";
import { type Pose, movedPoint } from "../../src/geometry/pose";
import { pointAt } from "../../src/geometry/rigid_fit";
import { anchorPoint } from "../../src/measures/anchor";
import type { ShownFace } from "../../src/measures/face_measures";
import { LandmarkBook } from "../../src/measures/landmark_book";
import type { PlanAnswers } from "../../src/measures/whole_band";
import { Plan } from "../../src/planning/plan";
import { smallCase, sourceOf } from "./small_case";

/** For PlanAnswers, by where the whole skin is. */
export function skinPointsOf({ surfaces }: CaseFile, skinUnder: (poses: readonly Pose[]) => (surface: number) => Float32Array): PlanAnswers["skinPointsAt"] {
  return async (poseSets, anchors) => poseSets.map((poses) => anchors.map((anchor) => anchorPoint({ positions: skinUnder(poses)(anchor.surface), triangles: surfaces[anchor.surface].triangles }, anchor)));
}

/** Skin and a lower jaw: the skin goes with the jaw by `share` of its way. */
export async function faceThatFollows(share: number, bandMm: number | null) {
  const file = await openCase(sourceOf(smallCase()));
  const landmarks = new LandmarkBook(file);
  landmarks.place("soft_pogonion", { surface: 0, triangle: 0, weights: [0.2, 0.3, 0.5] });
  landmarks.place("lower_midline", { surface: 1, triangle: 0, weights: [1, 0, 0] });
  const plan = new Plan(file);
  plan.change(0, { forwardMm: 4, yawDeg: 3 }, true);
  const skinUnder = (poses: readonly Pose[]) => (surface: number) => {
    const rest = file.surfaces[surface].positions;
    return Float32Array.from({ length: rest.length }, (_, i) => {
      const point = pointAt(rest, Math.floor(i / 3));
      return point[i % 3] + share * (movedPoint(poses[0], point)[i % 3] - point[i % 3]);
    });
  };
  const shown: ShownFace = {
    file,
    landmarks,
    positionsOf: (surface) => skinUnder(plan.poses())(surface),
    get shownPoses() {
      return new Map([["mandible", plan.poses()[0]]]);
    },
    bandOf: (surface) => (bandMm === null ? null : new Float32Array(file.surfaces[surface].positions.length / 3).fill(bandMm)),
    showsPlan: true,
  };
  const answers: PlanAnswers = { handles: plan.handles, poses: () => plan.poses(), skinPointsAt: skinPointsOf(file, skinUnder) };
  return { file, shown, answers, plan };
}
