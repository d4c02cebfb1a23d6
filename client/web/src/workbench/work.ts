// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Pose } from "../geometry/pose";
import type { Workbench } from "./workbench";

/** What is under the planner's hands, so that it is there again after a login: the poses of one case. */
interface Work {
  caseName: string;
  poses: [string, Pose][];
}

export function workOf(bench: Pick<Workbench, "caseName" | "plan" | "posesByHandle">): Work {
  return { caseName: bench.caseName, poses: Array.from(bench.posesByHandle(bench.plan.poses())) };
}

/** Nothing where `work` is of another case, or none. */
export function restoreWork(bench: Pick<Workbench, "caseName" | "plan">, work: unknown): void {
  const { caseName, poses } = (work ?? {}) as Partial<Work>;
  if (caseName !== bench.caseName || !Array.isArray(poses)) return;
  const known = poses.filter((entry) => Array.isArray(entry) && isPose(entry[1]));
  if (known.length > 0) bench.plan.setPoses(new Map(known));
}

function isPose(value: unknown): value is Pose {
  const pose = value as Partial<Pose> | null;
  return [pose?.rotationVector, pose?.pivotMm, pose?.translationMm].every(isVector) && Number.isFinite(pose?.scale);
}

function isVector(value: unknown): boolean {
  return Array.isArray(value) && value.length === 3 && value.every((number) => Number.isFinite(number));
}
