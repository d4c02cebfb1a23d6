// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { expect, test } from "vitest";
import { MEASURES } from "../../src/measures/definitions";
import { type MeasureResult, type MeasuredFace, evaluate } from "../../src/measures/evaluation";
import { FACE_LANDMARKS, sideProblem } from "../../src/measures/face_landmarks";
import type { FacePoint } from "../../src/measures/face_point";
import { ownDefinition, readOwnMeasures } from "../../src/measures/own_measures";
import { HAND_MADE_FACE, ITS_MEASURES } from "../testing/hand_made_face";

const definition = (name: string) => MEASURES.find((measure) => measure.name === name) ?? expect.fail(name);

function changed(changes: Record<string, Partial<FacePoint> | null>): Map<string, FacePoint> {
  const points = new Map(HAND_MADE_FACE);
  for (const [name, part] of Object.entries(changes)) {
    const point = points.get(name);
    if (part === null) points.delete(name);
    else if (point !== undefined) points.set(name, { ...point, ...part });
  }
  return points;
}

function measure(name: string, face: Partial<MeasuredFace> = {}): MeasureResult {
  return evaluate(definition(name), { before: HAND_MADE_FACE, after: HAND_MADE_FACE, bandsMm: null, isMiddleKnown: true, ...face });
}

function valueAfter(name: string, face: Partial<MeasuredFace>): number {
  const result = measure(name, face);
  return result.kind === "value" ? result.after : NaN;
}

test.each(MEASURES.map(({ name }) => name))("%s is what the hand-made face says", (name) => {
  expect(measure(name)).toMatchObject({ kind: "value", before: expect.closeTo(ITS_MEASURES[name], 12), after: expect.closeTo(ITS_MEASURES[name], 12) });
});

test.each<[string, string, Partial<FacePoint>, number]>([
  ["e_line_upper_lip", "labrale_superius", { forward: 5 }, 0],
  ["e_line_upper_lip", "labrale_superius", { forward: 10 }, 4],
  ["nasolabial_angle", "columella", { up: 0 }, 135],
  ["mentolabial_angle", "soft_pogonion", { forward: -5 }, 45],
  ["facial_convexity", "soft_pogonion", { forward: 30 }, -45],
  ["overjet", "lower_incisor", { forward: -6 }, -2],
  ["overbite", "lower_incisor", { up: -26 }, -2],
  ["incisor_show", "upper_incisor", { up: -20 }, -2],
  ["chin_midline", "soft_pogonion", { left: -3 }, -3],
  ["occlusal_cant", "upper_molar_left", { up: 20 }, -45],
])("%s has the sign of its definition when %s moves", (name, landmark, part, expected) => {
  expect(valueAfter(name, { after: changed({ [landmark]: part }) })).toBeCloseTo(expected, 12);
});

test("what moves everything by the same changes no measure but midlines", () => {
  const after = new Map(Array.from(HAND_MADE_FACE, ([name, { left, forward, up }]) => [name, { left, forward: forward + 7, up: up - 3 }]));
  for (const { name } of MEASURES) expect(valueAfter(name, { after })).toBeCloseTo(ITS_MEASURES[name], 9);
});

test("landmarks that are missing are named, in the order of the definition", () => {
  const before = changed({ soft_pogonion: null, pronasale: null });
  expect(measure("e_line_lower_lip", { before, after: before })).toMatchObject({ kind: "missing", landmarks: ["pronasale", "soft_pogonion"] });
  expect(measure("overjet", { before, after: before }).kind).toBe("value");
});

test.each<[string, Record<string, Partial<FacePoint>>, string]>([
  ["e_line_upper_lip", { pronasale: { forward: -12 } }, "no nose"],
  ["e_line_lower_lip", { pronasale: { up: -45 } }, "one below the other"],
  ["nasolabial_angle", { columella: { forward: 0, up: -10 } }, "coincide"],
  ["occlusal_cant", { upper_molar_left: { left: -30 } }, "swapped"],
])("%s of a degenerate profile is refused in a sentence", (name, changes, text) => {
  const result = measure(name, { before: changed(changes) });
  expect(result).toMatchObject({ kind: "impossible", text: expect.stringContaining(text) });
});

test("midlines need a midsagittal plane, other measures do not", () => {
  expect(measure("chin_midline", { isMiddleKnown: false })).toMatchObject({ kind: "impossible", text: expect.stringContaining("midsagittal plane") });
  expect(measure("overjet", { isMiddleKnown: false }).kind).toBe("value");
});

test("a band is the bands of the landmarks by their slopes, and none where none is known", () => {
  const bandsMm = new Map([["subnasale", 0.3], ["soft_menton", 0.5]]);
  expect(measure("lower_face_height", { bandsMm })).toMatchObject({ band: { lowest: expect.closeTo(49.2, 9), highest: expect.closeTo(50.8, 9) } });
  expect(measure("overjet", { bandsMm })).toMatchObject({ band: null });
  expect(measure("lower_face_height")).toMatchObject({ band: null });
});

test("distances and angles of one's own are in space", () => {
  const label = (name: string) => name;
  const face = { before: HAND_MADE_FACE, after: HAND_MADE_FACE, bandsMm: null, isMiddleKnown: true };
  const distance = ownDefinition({ landmarks: ["upper_molar_left", "upper_molar_right"] }, 0, label);
  expect(evaluate(distance, face)).toMatchObject({ kind: "value", after: expect.closeTo(Math.hypot(40, 2), 12) });
  expect([distance.name, distance.unit]).toEqual(["own_1", "mm"]);
  const angle = ownDefinition({ landmarks: ["labrale_superius", "subnasale", "columella"] }, 1, label);
  expect(evaluate(angle, face)).toMatchObject({ kind: "value", after: expect.closeTo(90, 12) });
  expect(readOwnMeasures([{ landmarks: ["a"] }, { landmarks: ["a", "b"] }, { landmarks: ["<b>", "c"] }, null])).toEqual([{ landmarks: ["a", "b"] }]);
});

test("a landmark on the wrong side is refused in a sentence", () => {
  const of = (name: string) => FACE_LANDMARKS.find((landmark) => landmark.name === name) ?? expect.fail(name);
  const at = (left: number) => ({ left, forward: 0, up: 0 });
  expect(sideProblem(of("upper_molar_left"), at(-20), true)).toMatch(/the patient’s right side/);
  expect(sideProblem(of("upper_molar_right"), at(20), true)).toMatch(/the patient’s left side/);
  expect(sideProblem(of("pronasale"), at(40), true)).toMatch(/40 mm off the midsagittal plane/);
  expect(sideProblem(of("pronasale"), at(-4), true)).toBe("");
  expect(sideProblem(of("pronasale"), at(40), false)).toBe("");
});
