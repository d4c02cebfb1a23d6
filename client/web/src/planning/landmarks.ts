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

/**
 * `poses` by handle; `skin`: where a vertex of the skin is now, null where that is not known (then the landmark stays).
 */
export function landmarkMovement(
  landmark: LandmarkEntry,
  poses: ReadonlyMap<string, Pose>,
  skin: (vertex: number) => Vector | null,
  frame: HeadFrame,
): LandmarkMovement {
  const pose = poses.get(landmark.handle);
  let now = landmark.positionMm;
  if (pose !== undefined) now = movedPoint(pose, landmark.positionMm);
  else if (landmark.skinVertex !== null) now = skin(landmark.skinVertex) ?? landmark.positionMm;
  const moved = subtract(now, landmark.positionMm);
  const [left, posterior, up] = apply(headAxes(frame), moved);
  return { label: landmark.label, forwardMm: -posterior, leftMm: left, upMm: up, totalMm: norm(moved) };
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
