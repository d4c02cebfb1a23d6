// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Pose } from "../geometry/pose";
import type { SavedLandmarks } from "../measures/landmark_book";
import type { Plan } from "../planning/plan";

/** What is under the planner's hands, so that it is there again after a login: the poses of one case. */
interface Work {
  caseName: string;
  poses: [string, Pose][];
}

/** The plan of one case, as a workbench has it. */
export interface SavedPlan {
  readonly caseName: string;
  readonly plan: Pick<Plan, "poses" | "setPoses">;
  posesByHandle(poses: readonly Pose[]): Map<string, Pose>;
}

const CARRIED_KEY = "tissueform-carried";

/** Keeps the poses of this tab until the page that comes next takes them. */
export function carryWork(bench: SavedPlan): void {
  sessionStorage.setItem(CARRIED_KEY, JSON.stringify(workOf(bench)));
}

/** For restoreWork; null where nothing was carried. */
export function takeCarriedWork(): unknown {
  const text = sessionStorage.getItem(CARRIED_KEY);
  sessionStorage.removeItem(CARRIED_KEY);
  return JSON.parse(text ?? "null");
}

export function workOf(bench: SavedPlan): Work {
  return { caseName: bench.caseName, poses: Array.from(bench.posesByHandle(bench.plan.poses())) };
}

/** Nothing where `work` is of another case, or none. */
export function restoreWork(bench: Pick<SavedPlan, "caseName" | "plan">, work: unknown): void {
  const { caseName, poses } = (work ?? {}) as Partial<Work>;
  if (caseName !== bench.caseName || !Array.isArray(poses)) return;
  const known = poses.filter((entry) => Array.isArray(entry) && isPose(entry[1]));
  if (known.length > 0) bench.plan.setPoses(new Map(known));
}

const LANDMARKS_KEY = "tissueform-landmarks";
const MOST_CASES = 32;

/** Landmarks of the cases that this browser has had open, the newest last: triangles of surfaces, nothing of a patient. */
function allLandmarks(): [string, unknown][] {
  try {
    const all: unknown = JSON.parse(localStorage.getItem(LANDMARKS_KEY) ?? "[]");
    return Array.isArray(all) ? all.filter((entry): entry is [string, unknown] => Array.isArray(entry) && typeof entry[0] === "string") : [];
  } catch {
    return [];
  }
}

export function recallLandmarks(caseName: string): unknown {
  return allLandmarks().find(([name]) => name === caseName)?.[1];
}

/** Where the browser has no room they last as long as the page. */
export function rememberLandmarks(caseName: string, landmarks: SavedLandmarks): void {
  const others = allLandmarks().filter(([name]) => name !== caseName);
  try {
    localStorage.setItem(LANDMARKS_KEY, JSON.stringify([...others, [caseName, landmarks]].slice(-MOST_CASES)));
  } catch {
    return;
  }
}

function isPose(value: unknown): value is Pose {
  const pose = value as Partial<Pose> | null;
  return [pose?.rotationVector, pose?.pivotMm, pose?.translationMm].every(isVector) && Number.isFinite(pose?.scale);
}

function isVector(value: unknown): boolean {
  return Array.isArray(value) && value.length === 3 && value.every((number) => Number.isFinite(number));
}
