// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { LandmarkEntry } from "../case/manifest";
import { formatDirection, formatNumber } from "./numbers";
import { type HeadFrame, type Pose, headAxes, movedPoint } from "../geometry/pose";
import { type Vector, apply, norm, subtract } from "../geometry/rotation";

/** Where a landmark went, in the head frame, in mm. */
export interface LandmarkMovement {
  label: string;
  forwardMm: number;
  leftMm: number;
  upMm: number;
  totalMm: number;
}

/** A landmark on a segment moves with the segment, even if a vertex of the skin is near it. */
export function isOnSkin({ handle, skinVertex }: LandmarkEntry): boolean {
  return handle === "" && skinVertex !== null;
}

/**
 * The same rule as PredictCase in core/planning/case_file/predicted_case.cc. A landmark of the skin does not lie exactly on its vertex, so
 * it moves by the vertex's displacement and keeps its offset. `poses` by handle; `skinMove`: displacement of a vertex of the first
 * skin from rest, LPS, mm.
 */
export function landmarkMovement(
  landmark: LandmarkEntry,
  poses: ReadonlyMap<string, Pose>,
  skinMove: (vertex: number) => Vector,
  frame: HeadFrame,
): LandmarkMovement {
  const { handle, positionMm, skinVertex } = landmark;
  const pose = poses.get(handle);
  let moved: Vector = [0, 0, 0];
  if (pose !== undefined) moved = subtract(movedPoint(pose, positionMm), positionMm);
  else if (isOnSkin(landmark)) moved = skinMove(skinVertex as number);
  return { label: landmark.label, ...movementOf(moved, frame) };
}

/** Of a way in LPS, mm. */
export function movementOf(moved: Vector, frame: HeadFrame): Omit<LandmarkMovement, "label"> {
  const [left, posterior, up] = apply(headAxes(frame), moved);
  return { forwardMm: -posterior, leftMm: left, upMm: up, totalMm: norm(moved) };
}

/** "8.0 mm forward, 1.2 mm up", or "at rest". */
export function describeMovement(movement: LandmarkMovement): string {
  const parts = [
    formatDirection(movement.forwardMm, "forward", "back"),
    formatDirection(movement.leftMm, "left", "right"),
    formatDirection(movement.upMm, "up", "down"),
  ].filter((part) => part !== "");
  return parts.length === 0 ? "at rest" : parts.join(", ");
}

/** For a table: a number, "·" for nothing. */
export function cell(value: number): string {
  const text = formatNumber(value);
  return Number(text.replace("−", "-")) === 0 ? "·" : text;
}
