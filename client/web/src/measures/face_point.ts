// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { CaseFile } from "../case/case_file";
import { type HeadFrame, headAxes } from "../geometry/pose";
import { type Vector, apply, subtract } from "../geometry/rotation";

/** A point in the head frame, in mm from its origin: the patient's left, forward and up are positive. */
export interface FacePoint {
  left: number;
  forward: number;
  up: number;
}

export function toFacePoint(point: Vector, frame: HeadFrame): FacePoint {
  const [left, posterior, up] = apply(headAxes(frame), subtract(point, frame.originMm));
  return { left, forward: -posterior, up };
}

const scannerFrames = new WeakMap<CaseFile, HeadFrame>();

/** Whether the frame is the head's: else the axes are the scanner's, and where the midsagittal plane lies is not known. */
export function hasHeadFrame(file: CaseFile): boolean {
  return file.manifest.headFrame.source !== "scanner";
}

/** The frame of the face's measures: the head frame, or without one the scanner's axes about the middle of the skin. */
export function faceFrame(file: CaseFile): HeadFrame {
  const { headFrame } = file.manifest;
  const skin = file.surfaces.find(({ entry }) => entry.kind === "skin");
  if (hasHeadFrame(file) || skin === undefined) return headFrame;
  const known = scannerFrames.get(file);
  if (known !== undefined) return known;
  const ends = [0, 1, 2].map((axis) => endsOf(skin.positions, axis));
  const frame = { ...headFrame, originMm: ends.map(([low, high]) => (low + high) / 2) as Vector };
  scannerFrames.set(file, frame);
  return frame;
}

function endsOf(positions: Float32Array, axis: number): [number, number] {
  let [low, high] = [Infinity, -Infinity];
  for (let i = axis; i < positions.length; i += 3) [low, high] = [Math.min(low, positions[i]), Math.max(high, positions[i])];
  return [low, high];
}

/** What measures are made of, by name. */
export type FacePoints = ReadonlyMap<string, FacePoint>;

export function distanceMm(a: FacePoint, b: FacePoint): number {
  return Math.hypot(a.left - b.left, a.forward - b.forward, a.up - b.up);
}

const DEGREES = 180 / Math.PI;

/** At `at` between two others, in space, 0 to 180. */
export function angleDeg(a: FacePoint, at: FacePoint, b: FacePoint): number {
  const u = [a.left - at.left, a.forward - at.forward, a.up - at.up];
  const v = [b.left - at.left, b.forward - at.forward, b.up - at.up];
  const across = Math.hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]);
  return Math.atan2(across, u[0] * v[0] + u[1] * v[1] + u[2] * v[2]) * DEGREES;
}

/** In the midsagittal plane, at `at`, measured through the front from the lower to the upper one: 0 to 360. */
export function profileAngleDeg(upper: FacePoint, at: FacePoint, lower: FacePoint): number {
  const turn = (to: FacePoint) => Math.atan2(to.up - at.up, to.forward - at.forward) * DEGREES;
  return (turn(upper) - turn(lower) + 360) % 360;
}

/** In the midsagittal plane. */
export function profileDistanceMm(a: FacePoint, b: FacePoint): number {
  return Math.hypot(a.forward - b.forward, a.up - b.up);
}
