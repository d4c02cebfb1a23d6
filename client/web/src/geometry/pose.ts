// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type Matrix, type Vector, add, apply, fromRotationVector, multiply, subtract, toRotationVector, transpose } from "./rotation";

/** Axes of a head: unit vectors at right angles, in LPS. */
export interface HeadFrame {
  originMm: Vector;
  left: Vector;
  posterior: Vector;
  superior: Vector;
  /** "landmarks", "recipe" or "scanner". */
  source: string;
}

/**
 * How a segment moves, as a planner says it: in the head frame, about a pivot (docs/case-format.md, "Pitch, roll and yaw").
 * Millimetres are those of the pivot.
 */
export interface SegmentMove {
  forwardMm: number;
  leftMm: number;
  upMm: number;
  pitchDeg: number;
  rollDeg: number;
  yawDeg: number;
  scale: number;
}

export type MoveKey = Exclude<keyof SegmentMove, "scale">;

export const NO_MOVE: Readonly<SegmentMove> = { forwardMm: 0, leftMm: 0, upMm: 0, pitchDeg: 0, rollDeg: 0, yawDeg: 0, scale: 1 };

/** x = pivot + scale * exp([rotationVector]) * (v - pivot) + translation; mm and radians, LPS. */
export interface Pose {
  rotationVector: Vector;
  pivotMm: Vector;
  translationMm: Vector;
  scale: number;
}

const RADIANS = Math.PI / 180;

/** Rows are left, posterior, superior: turns LPS into the head frame's axes. */
export function headAxes(frame: HeadFrame): Matrix {
  return [...frame.left, ...frame.posterior, ...frame.superior];
}

/** A shift by so many mm forward, to the patient's left and up, in LPS. */
export function toLps({ forwardMm, leftMm, upMm }: Pick<SegmentMove, "forwardMm" | "leftMm" | "upMm">, frame: HeadFrame): Vector {
  return apply(transpose(headAxes(frame)), [leftMm, -forwardMm, upMm]);
}

/** The inverse of toLps. */
export function fromLps(shift: Vector, frame: HeadFrame): Pick<SegmentMove, "forwardMm" | "leftMm" | "upMm"> {
  const [left, posterior, up] = apply(headAxes(frame), shift);
  return { forwardMm: -posterior, leftMm: left, upMm: up };
}

/** R = Rz(yaw) Rx(-pitch) Ry(roll), in the head frame's axes. */
export function rotationOf(pitchDeg: number, rollDeg: number, yawDeg: number): Matrix {
  const z = fromRotationVector([0, 0, yawDeg * RADIANS]);
  const x = fromRotationVector([-pitchDeg * RADIANS, 0, 0]);
  const y = fromRotationVector([0, rollDeg * RADIANS, 0]);
  return multiply(z, multiply(x, y));
}

/** The inverse of rotationOf: pitch from -90 to 90, roll and yaw from -180 to 180; yaw is 0 where pitch is +-90. */
export function anglesOf(m: Matrix): { pitchDeg: number; rollDeg: number; yawDeg: number } {
  const cosine = Math.hypot(m[6], m[8]);
  const pitchDeg = -Math.atan2(m[7], cosine) / RADIANS;
  if (cosine < 1e-9) return { pitchDeg, rollDeg: Math.atan2(m[2], m[0]) / RADIANS, yawDeg: 0 };
  return { pitchDeg, rollDeg: Math.atan2(-m[6], m[8]) / RADIANS, yawDeg: Math.atan2(-m[1], m[4]) / RADIANS };
}

/** The pose of a segment that moves so about `pivotMm`. */
export function toPose(move: SegmentMove, pivotMm: Vector, frame: HeadFrame): Pose {
  const axes = headAxes(frame);
  const rotation = rotationOf(move.pitchDeg, move.rollDeg, move.yawDeg);
  return {
    rotationVector: apply(transpose(axes), toRotationVector(rotation)),
    pivotMm,
    translationMm: apply(transpose(axes), [move.leftMm, -move.forwardMm, move.upMm]),
    scale: move.scale,
  };
}

/** The same movement of every point, expressed about `pivotMm`; whole turns are lost. */
export function toMove(pose: Pose, pivotMm: Vector, frame: HeadFrame): SegmentMove {
  const axes = headAxes(frame);
  const rotation = multiply(axes, multiply(fromRotationVector(pose.rotationVector), transpose(axes)));
  const [left, posterior, up] = apply(axes, subtract(movedPoint(pose, pivotMm), pivotMm));
  return { forwardMm: -posterior, leftMm: left, upMm: up, ...anglesOf(rotation), scale: pose.scale };
}

export function movedPoint(pose: Pose, point: Vector): Vector {
  const turned = apply(fromRotationVector(pose.rotationVector), subtract(point, pose.pivotMm));
  return add(add(pose.pivotMm, [turned[0] * pose.scale, turned[1] * pose.scale, turned[2] * pose.scale]), pose.translationMm);
}

/** Between `a` and `b`, which are about one pivot: share 0 is `a`, 1 is `b`. */
export function between(a: SegmentMove, b: SegmentMove, share: number): SegmentMove {
  const mix = (key: keyof SegmentMove) => a[key] + share * (b[key] - a[key]);
  return {
    forwardMm: mix("forwardMm"),
    leftMm: mix("leftMm"),
    upMm: mix("upMm"),
    pitchDeg: mix("pitchDeg"),
    rollDeg: mix("rollDeg"),
    yawDeg: mix("yawDeg"),
    scale: mix("scale"),
  };
}
