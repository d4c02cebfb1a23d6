// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { readFileSync } from "node:fs";
import { describe, expect, test } from "vitest";
import { type HeadFrame, NO_MOVE, anglesOf, movedPoint, rotationOf, toMove, toPose } from "../../src/geometry/pose";
import { type Vector, fromRotationVector, multiply, toRotationVector, transpose } from "../../src/geometry/rotation";

interface Angles {
  pitch_deg: number;
  roll_deg: number;
  yaw_deg: number;
}

interface Golden {
  same_rotation: { name: string; head_frame: string; given: Angles; told: Angles }[];
  head_frames: Record<string, { left: Vector; posterior: Vector; superior: Vector }>;
  rotations: { name: string; head_frame: string; pitch_deg: number; roll_deg: number; yaw_deg: number; rotation_vector_deg: Vector }[];
}

const golden = JSON.parse(readFileSync(new URL("../../../../tests/data/pitch_roll_yaw.json", import.meta.url), "utf8")) as Golden;
const frameOf = (name: string): HeadFrame => ({ originMm: [0, 0, 0], ...golden.head_frames[name], source: "test" });
const tilted = frameOf("tilted");

describe("pitch, roll and yaw", () => {
  test.each(golden.rotations.map((entry) => [`${entry.name}, ${entry.head_frame}`, entry] as const))("of %s are the shared vectors", (_, entry) => {
    const frame = frameOf(entry.head_frame);
    const move = { ...NO_MOVE, pitchDeg: entry.pitch_deg, rollDeg: entry.roll_deg, yawDeg: entry.yaw_deg };
    const pose = toPose(move, [1, 2, 3], frame);
    const expected = fromRotationVector(entry.rotation_vector_deg.map((part) => (part * Math.PI) / 180) as Vector);
    fromRotationVector(pose.rotationVector).forEach((part, i) => expect(part).toBeCloseTo(expected[i], 12));
    const back = toMove(pose, [1, 2, 3], frame);
    // Of a turn with pitch 90 degrees other angles may describe the same rotation: then yaw is 0.
    if (Math.abs(entry.pitch_deg) < 90) {
      expect(back.pitchDeg).toBeCloseTo(entry.pitch_deg, 9);
      expect(Math.cos(((back.rollDeg - entry.roll_deg) * Math.PI) / 180)).toBeCloseTo(1, 12);
      expect(Math.cos(((back.yawDeg - entry.yaw_deg) * Math.PI) / 180)).toBeCloseTo(1, 12);
    } else expect(back.yawDeg).toBe(0);
  });

  test.each(golden.same_rotation.map((entry) => [entry.name, entry] as const))("%s", (_, { given, told: expected }) => {
    const angles = anglesOf(rotationOf(given.pitch_deg, given.roll_deg, given.yaw_deg));
    expect(angles.pitchDeg).toBeCloseTo(expected.pitch_deg, 6);
    expect(Math.cos(((angles.rollDeg - expected.roll_deg) * Math.PI) / 180)).toBeCloseTo(1, 9);
    expect(Math.cos(((angles.yawDeg - expected.yaw_deg) * Math.PI) / 180)).toBeCloseTo(1, 9);
  });

  test("positive pitch raises the chin, roll lowers the left side, yaw turns to the left", () => {
    const front: Vector = [0, -10, 0];
    const left: Vector = [10, 0, 0];
    const scanner = frameOf("scanner");
    const moved = (part: object, point: Vector) => movedPoint(toPose({ ...NO_MOVE, ...part }, [0, 0, 0], scanner), point);
    expect(moved({ pitchDeg: 10 }, front)[2]).toBeGreaterThan(1);
    expect(moved({ rollDeg: 10 }, left)[2]).toBeLessThan(-1);
    expect(moved({ yawDeg: 10 }, front)[0]).toBeGreaterThan(1);
    expect(moved({ forwardMm: 8 }, front)).toEqual([0, -18, 0]);
  });

  test("come back from any pose within the angles' ranges", () => {
    for (let i = 0; i < 300; ++i) {
      const [pitch, roll, yaw] = [((i * 37) % 178) - 89, ((i * 53) % 359) - 179, ((i * 71) % 359) - 179];
      const angles = anglesOf(rotationOf(pitch, roll, yaw));
      expect(angles.pitchDeg).toBeCloseTo(pitch, 7);
      expect(angles.rollDeg).toBeCloseTo(roll, 7);
      expect(angles.yawDeg).toBeCloseTo(yaw, 7);
    }
  });

  test("about another pivot are the same movement", () => {
    const pose = toPose({ forwardMm: 4, leftMm: -2, upMm: 1, pitchDeg: 6, rollDeg: -3, yawDeg: 9, scale: 1 }, [10, -40, 5], tilted);
    const other = toPose(toMove(pose, [-3, 8, 20], tilted), [-3, 8, 20], tilted);
    for (const point of [[0, 0, 0], [30, -70, 12]] as Vector[]) {
      movedPoint(other, point).forEach((part, k) => expect(part).toBeCloseTo(movedPoint(pose, point)[k], 9));
    }
  });
});

describe("a rotation vector", () => {
  test.each([0, 1e-9, 1e-4, 1, 3, Math.PI - 1e-7, Math.PI])("of %d radians comes back", (angle) => {
    for (const axis of [[1, 0, 0], [0, 1, 0], [0, 0, -1], [0.6, 0, 0.8], [2 / 3, -2 / 3, 1 / 3]] as Vector[]) {
      const m = fromRotationVector([axis[0] * angle, axis[1] * angle, axis[2] * angle]);
      fromRotationVector(toRotationVector(m)).forEach((part, i) => expect(part).toBeCloseTo(m[i], 9));
    }
  });

  test("makes a matrix whose transpose is its inverse", () => {
    const m = fromRotationVector([0.3, -1.2, 2.1]);
    multiply(m, transpose(m)).forEach((part, i) => expect(part).toBeCloseTo(i % 4 === 0 ? 1 : 0, 12));
  });
});
