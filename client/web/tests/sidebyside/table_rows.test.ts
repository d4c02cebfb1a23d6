// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { expect, test } from "vitest";
import { type CaseFile, openCase } from "../../src/case/case_file";
import type { SegmentMove } from "../../src/geometry/pose";
import { suggestLandmarks } from "../../src/measures/face_measures";
import { LandmarkBook } from "../../src/measures/landmark_book";
import { Plan } from "../../src/planning/plan";
import { type Row, type TabledPlan, missingCount, tableGroups } from "../../src/sidebyside/table_rows";
import type { TargetPlace } from "../../src/workbench/target_place";
import { ITS_MEASURES } from "../testing/hand_made_face";
import { handMadeCase } from "../testing/hand_made_case";
import { sourceOf } from "../testing/small_case";

interface Face {
  letter: string;
  move: Partial<SegmentMove>;
  /** All skin goes so far forward. */
  skinMm: number;
  overlapMm?: number;
  isAnswered?: boolean;
}

/** The hand-made face, whose measures are known by hand, under movements of jaw and skin that are given. */
function plan(file: CaseFile, landmarks: LandmarkBook, { letter, move, skinMm, overlapMm = 0, isAnswered = true }: Face): TabledPlan {
  const moves = new Plan(file);
  moves.change(0, move, true);
  const forward = (positions: Float32Array) => positions.map((value, i) => (i % 3 === 1 ? value - skinMm : value));
  return {
    file,
    landmarks,
    letter,
    name: letter,
    label: letter,
    plan: moves,
    isAnswered,
    bands: null,
    movementBands: null,
    status: "",
    showsPlan: true,
    uncertainty: null,
    displacements: forward(new Float32Array(3 * file.followed.length)),
    shownPoses: new Map([["mandible", moves.poses()[0]]]),
    penetrations: { value: overlapMm > 0 ? [["Lower jaw", "Upper jaw"], ["Upper jaw", "Lower jaw"]].map(([segment, other]) => ({ segment, other, depthMm: overlapMm, points: [] })) : [] },
    positionsOf: (surface: number) => (file.surfaces[surface].follows === null ? file.surfaces[surface].positions : forward(file.surfaces[surface].positions)),
    bandOf: () => null,
    largest: () => ({ largestMm: Math.abs(skinMm), band: null }),
  } as unknown as TabledPlan;
}

/** Its suggestions are found once: that takes the longest. */
const FILE = await openCase(sourceOf(handMadeCase()));
const SUGGESTED = suggestLandmarks(FILE, new LandmarkBook(FILE));

function plans(...faces: Face[]): TabledPlan[] {
  const landmarks = new LandmarkBook(FILE);
  landmarks.suggest(SUGGESTED);
  landmarks.confirm(Array.from(SUGGESTED.keys()));
  return faces.map((face) => plan(FILE, landmarks, face));
}

const AT_REST: Face = { letter: "A", move: {}, skinMm: 0 };
const FORWARD: Face = { letter: "B", move: { forwardMm: 2, leftMm: 1 }, skinMm: 1.5 };
const NO_AIMS = { reference: null, targets: [] };

function rowsOf(groups: ReturnType<typeof tableGroups>): Map<string, Row> {
  return new Map(groups.flatMap(({ rows }) => rows).map((row) => [row.id, row]));
}

test("at rest nothing moves, and measures are those of the hand-made face", () => {
  const rows = rowsOf(tableGroups(plans(AT_REST, { ...AT_REST, letter: "B" }), NO_AIMS));
  const moving = Array.from(rows.values()).filter(({ id }) => id.startsWith("landmark:") || id === "largest");
  expect(moving.length).toBeGreaterThan(10);
  for (const { cells } of moving) expect(cells).toEqual([{ text: "0.0", notes: [], warning: "" }, { text: "0.0", notes: [], warning: "" }]);
  expect(Array.from(rows.keys()).filter((id) => id.startsWith("move:"))).toEqual([]);
  for (const [name, value] of Object.entries(ITS_MEASURES)) {
    const { preOp, cells } = rows.get(name) as Row;
    expect([preOp, ...cells.map((cell) => cell?.text)].map((text) => Number(text?.replace("−", "-"))), name).toEqual(Array(3).fill(Number(value.toFixed(1))));
  }
});

test("a plan's numbers are its own, with differences to pre-op or to another plan", () => {
  const [a, b] = plans(AT_REST, FORWARD);
  const toPreOp = rowsOf(tableGroups([a, b], NO_AIMS));
  expect(toPreOp.get("move:mandible:forwardMm")?.cells.map((cell) => cell?.text)).toEqual(["0.0", "2.0"]);
  expect(toPreOp.get("overjet")).toMatchObject({ preOp: "3.0", cells: [{ text: "3.0", notes: ["0.0 to pre-op"] }, { text: "1.0", notes: ["−2.0 to pre-op"] }] });
  expect(toPreOp.get("lower_midline")?.cells[1]).toMatchObject({ text: "−0.5", notes: ["+1.0 to pre-op"] });
  expect(toPreOp.get("landmark:soft_pogonion")?.cells[1]).toMatchObject({ text: "1.5", notes: ["1.5 mm forward"] });
  expect(toPreOp.get("landmark:lower_incisor")?.cells[1]).toMatchObject({ text: "2.2", notes: ["2.0 mm forward, 1.0 mm left"] });
  const toB = rowsOf(tableGroups([a, b], { ...NO_AIMS, reference: b }));
  expect(toB.get("overjet")?.cells).toMatchObject([{ notes: ["+2.0 to B"] }, { notes: [] }]);
  expect(toB.get("landmark:lower_incisor")?.cells[0]?.notes).toEqual(["2.2 from B"]);
});

test("a value beyond a norm's deviation is marked, one within it is not", () => {
  // The norm of the nasolabial angle is 102 with a deviation of 8, that of the upper lip has none; the face has 90 and -4.
  const rows = rowsOf(tableGroups(plans(AT_REST), NO_AIMS));
  expect(rows.get("nasolabial_angle")?.cells[0]?.warning).toBe("outside norm");
  expect(rows.get("e_line_upper_lip")?.cells[0]?.warning).toBe("");
});

test("targets are reached or missed by plan", () => {
  const place: TargetPlace = { pointMm: [0, 0, 0], vertices: null, share: 1, drawnMm: [0, 0, 0], follows: [[0, 1]] };
  const target = { label: "Chin", place, move: { forwardMm: 2, leftMm: 3, upMm: 0 }, isAlong: false };
  const forwardOnly = { ...target, move: { forwardMm: 2, leftMm: 0, upMm: 0 }, isAlong: true };
  const rows = rowsOf(tableGroups(plans(AT_REST, FORWARD), { reference: null, targets: [target, forwardOnly] }));
  expect(rows.get("target:0")).toMatchObject({ preOp: "3.6", note: "target: 2.0 mm forward, 3.0 mm left" });
  // 3.04 = sqrt(0.5² + 3²)
  expect(rows.get("target:0")?.cells).toMatchObject([{ text: "3.6", warning: "not reached" }, { text: "3.0", warning: "not reached" }]);
  expect(rows.get("target:1")?.cells).toMatchObject([{ text: "2.0", warning: "not reached" }, { text: "0.5", notes: ["reached"], warning: "" }]);
});

test("overlap of bone has a row only where a plan has some", () => {
  expect(rowsOf(tableGroups(plans(AT_REST, FORWARD), NO_AIMS)).has("overlap")).toBe(false);
  const rows = rowsOf(tableGroups(plans(AT_REST, { ...FORWARD, overlapMm: 1.25 }), NO_AIMS));
  expect(rows.get("overlap")?.cells).toMatchObject([{ text: "0.0", warning: "" }, { text: "1.3", notes: ["Lower jaw and Upper jaw"], warning: "bone overlaps" }]);
});

test("a plan that waits for its answer has no number of the face", () => {
  const rows = rowsOf(tableGroups(plans(AT_REST, { ...FORWARD, isAnswered: false }), NO_AIMS));
  for (const row of ["largest", "overjet", "landmark:soft_pogonion"]) expect(rows.get(row)?.cells[1], row).toBeNull();
  expect(rows.get("move:mandible:forwardMm")?.cells[1]?.text).toBe("2.0");
});

test("measures without their landmarks are counted and not listed", () => {
  const [a] = plans(AT_REST);
  a.landmarks.remove("pronasale");
  expect(rowsOf(tableGroups([a], NO_AIMS)).has("e_line_upper_lip")).toBe(false);
  expect(missingCount(a)).toBe(2);
});
