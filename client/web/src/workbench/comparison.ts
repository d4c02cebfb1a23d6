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
  /** The band of each of CaseFile.followed, mm; null where none is known. */
  uncertainty: Float32Array | null;
  /** In the order of the plan's handles. */
  poses: Pose[];
}

/** Finds what lies between two answers. */
export class Comparer {
  /** `bandOf`: of a prediction's face, null where none is known: what is stored holds none. */
  constructor(
    private readonly plan: Plan,
    private readonly answers: Pick<Answers, "ofPrediction">,
    private readonly bandOf: (prediction: Prediction, poses: readonly Pose[]) => Promise<Float32Array | null>,
  ) {}

  /** Between its ends it is no answer, and has no band. `planned`: what the plan shows. Rejects with a CallError where a prediction cannot be had. */
  async between({ from, to, share }: Comparison, planned: Shape): Promise<Shape> {
    const [a, b] = await Promise.all([this.shapeOf(from, planned), this.shapeOf(to, planned)]);
    return {
      displacements: mix(a.displacements, b.displacements, share),
      uncertainty: share === 1 ? b.uncertainty : share === 0 ? a.uncertainty : null,
      poses: a.poses.map((pose, index) => this.plan.poseBetween(index, pose, b.poses[index], share)),
    };
  }

  private async shapeOf(what: Comparison["from"], planned: Shape): Promise<Shape> {
    if (what === "plan") return planned;
    const rest = this.plan.restPoses();
    if (what === "rest") return { displacements: new Float32Array(planned.displacements.length), uncertainty: null, poses: rest };
    const stored = fromMessages(what.poses);
    const poses = this.plan.handles.map((handle, index) => stored.get(handle.name) ?? rest[index]);
    const [displacements, uncertainty] = await Promise.all([this.answers.ofPrediction(what), this.bandOf(what, poses)]);
    return { displacements, uncertainty, poses };
  }
}
