// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { CaseFile } from "../case/case_file";
import { type Pose, movedPoint } from "../geometry/pose";
import { pointAt } from "../geometry/rigid_fit";
import { type Vector, add, apply, dot, fromRotationVector, multiply, norm, scaled, subtract, toRotationVector } from "../geometry/rotation";

/** The hinge about which the lower jaw opens: through both condyles. */
export interface HingeAxis {
  /** LPS, at rest. */
  left: Vector;
  right: Vector;
  /** The case's landmarks, or fitted from the upper back ends of the lower jaw. */
  source: "landmarks" | "ends of the lower jaw";
}

/** Beyond this the condyles of a patient glide forward, and a hinge says nothing true. */
export const MOST_OPENING_DEG = 25;

const LOWER_LANDMARKS = ["lower_incisor", "lower_molar_left", "lower_molar_right", "pogonion", "menton"];
const LOWER_NAMES = /^(mandible|chin|lower_jaw|genioplasty)/;

/** Handles that go along when the jaw opens: those that carry landmarks of the lower jaw, or are named so. */
export function lowerJawHandles({ manifest }: CaseFile): string[] {
  const carriers = manifest.landmarks.filter(({ name }) => LOWER_LANDMARKS.includes(name)).map(({ handle }) => handle);
  return manifest.handles.map(({ name }) => name).filter((name) => carriers.includes(name) || LOWER_NAMES.test(name));
}

/** Null where the case has neither landmarks of the condyles nor a segment of the lower jaw. */
export function hingeAxis(file: CaseFile): HingeAxis | null {
  const at = (name: string) => file.manifest.landmarks.find((landmark) => landmark.name === name)?.positionMm;
  const [left, right] = [at("condyle_left"), at("condyle_right")];
  if (left !== undefined && right !== undefined) return { left, right, source: "landmarks" };
  return fittedAxis(file);
}

/** Of each half of the lower jaw the mean of what lies furthest back and up: a hundredth of its vertices. */
function fittedAxis(file: CaseFile): HingeAxis | null {
  const { left, posterior, superior, originMm } = file.manifest.headFrame;
  const lower = lowerJawHandles(file);
  const points = file.surfaces
    .filter(({ entry }) => entry.kind === "segment" && lower.includes(entry.handle))
    .flatMap(({ positions }) => Array.from({ length: positions.length / 3 }, (_, v) => pointAt(positions, v)));
  const end = (side: number): Vector | null => {
    const half = points.filter((point) => side * dot(left, subtract(point, originMm)) > 0);
    if (half.length === 0) return null;
    const height = (point: Vector) => dot(posterior, point) + dot(superior, point);
    const ends = half.sort((a, b) => height(b) - height(a)).slice(0, Math.ceil(half.length / 100));
    return scaled(ends.reduce(add), 1 / ends.length);
  };
  const [a, b] = [end(1), end(-1)];
  return a === null || b === null || norm(subtract(a, b)) < 10 ? null : { left: a, right: b, source: "ends of the lower jaw" };
}

/** `pose` with the jaw open by so many degrees about the hinge: what lies before it goes down. */
export function opened(pose: Pose, { left, right }: HingeAxis, degrees: number): Pose {
  if (degrees === 0) return pose;
  const axis = subtract(left, right);
  // About an axis to the patient's left what lies in front, at negative y of LPS, goes down by a positive angle.
  const turn = fromRotationVector(scaled(axis, (degrees * Math.PI) / 180 / norm(axis)));
  const rotation = multiply(turn, fromRotationVector(pose.rotationVector));
  const middle = scaled(add(left, right), 0.5);
  const moved = add(middle, apply(turn, subtract(movedPoint(pose, pose.pivotMm), middle)));
  return { ...pose, rotationVector: toRotationVector(rotation), translationMm: subtract(moved, pose.pivotMm) };
}

/** The jaw of one case, which may be open: a look at it, no part of the plan. */
export class JawOpening {
  /** Null where the case has no hinge. */
  readonly hinge: HingeAxis | null;
  degrees = 0;
  private readonly lower: readonly string[];

  constructor(private readonly file: CaseFile) {
    this.hinge = hingeAxis(file);
    this.lower = lowerJawHandles(file);
  }

  /** `poses` of the case's handles, with the jaw open. */
  apply(poses: readonly Pose[]): Pose[] {
    const { hinge, degrees } = this;
    if (hinge === null || degrees === 0) return [...poses];
    return poses.map((pose, index) => (this.lower.includes(this.file.manifest.handles[index].name) ? opened(pose, hinge, degrees) : pose));
  }
}

/** Between the edges of upper and lower incisor, in mm, under these poses; null where the case does not know them. */
export function incisorDistanceMm({ manifest }: CaseFile, poses: ReadonlyMap<string, Pose>): number | null {
  const now = ["upper_incisor", "lower_incisor"].map((name) => {
    const landmark = manifest.landmarks.find((known) => known.name === name);
    if (landmark === undefined) return null;
    const pose = poses.get(landmark.handle);
    return pose === undefined ? landmark.positionMm : movedPoint(pose, landmark.positionMm);
  });
  return now[0] === null || now[1] === null ? null : norm(subtract(now[0], now[1]));
}
