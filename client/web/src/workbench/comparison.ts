// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Prediction } from "../generated/tissueform/v1/prediction_pb";
import type { Pose } from "../geometry/pose";
import { fromMessages } from "../live/pose_messages";
import type { Plan } from "../planning/plan";
import type { Answers } from "./answers";
import { mix } from "./face_colors";

/** The face between two: the plan (or the rest shape) and a prediction. */
export interface Comparison {
  from: Prediction | "plan" | "rest";
  to: Prediction;
  /** 0: `from`, 1: `to`. */
  share: number;
}

/** Skin and bone at one moment. */
export interface Shape {
  /** Three of each of CaseFile.followed, mm. */
  displacements: Float32Array;
  /** In the order of the plan's handles. */
  poses: Pose[];
}

/** Finds what lies between two answers. */
export class Comparer {
  constructor(
    private readonly plan: Plan,
    private readonly answers: Answers,
  ) {}

  /** `planned`: what the plan shows. Rejects with a CallError where a prediction cannot be had. */
  async between({ from, to, share }: Comparison, planned: Shape): Promise<Shape> {
    const [a, b] = await Promise.all([this.shapeOf(from, planned), this.shapeOf(to, planned)]);
    return {
      displacements: mix(a.displacements, b.displacements, share),
      poses: a.poses.map((pose, index) => this.plan.poseBetween(index, pose, b.poses[index], share)),
    };
  }

  private async shapeOf(what: Comparison["from"], planned: Shape): Promise<Shape> {
    if (what === "plan") return planned;
    const rest = this.plan.restPoses();
    if (what === "rest") return { displacements: new Float32Array(planned.displacements.length), poses: rest };
    const poses = fromMessages(what.poses);
    return {
      displacements: await this.answers.ofPrediction(what),
      poses: this.plan.handles.map((handle, index) => poses.get(handle.name) ?? rest[index]),
    };
  }
}
