// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { beforeEach, expect, test } from "vitest";
import { type CaseFile, openCase } from "../../src/case/case_file";
import { type ShownFace, measureFace, shownPoint, toMessages } from "../../src/measures/face_measures";
import { type Anchor, nearestAnchor, readAnchor } from "../../src/measures/anchor";
import { faceFrame } from "../../src/measures/face_point";
import { LandmarkBook } from "../../src/measures/landmark_book";
import { cutProfile, outline } from "../../src/measures/profile";
import { suggestFromProfile } from "../../src/measures/suggestions";
import { smallCase, sourceOf } from "../testing/small_case";

let file: CaseFile;
let book: LandmarkBook;
beforeEach(async () => {
  file = await openCase(sourceOf(smallCase()));
  book = new LandmarkBook(file);
});

const SKIN = 0;
const SEGMENT = 1;
const middle = (surface: number): Anchor => ({ surface, triangle: 0, weights: [1 / 3, 1 / 3, 1 / 3] });

function shown(changes: Partial<ShownFace> = {}): ShownFace {
  return {
    file,
    landmarks: book,
    positionsOf: (surface) => file.surfaces[surface].positions,
    shownPoses: new Map(),
    bandOf: () => null,
    showsPlan: true,
    ...changes,
  };
}

test("a landmark moves with its triangle, and on bone with its segment", () => {
  const positions = file.surfaces[SKIN].positions.map((value, i) => value + (i % 3 === 1 ? -3 : 0));
  expect(shownPoint(shown({ positionsOf: () => positions }), middle(SKIN))).toEqual([expect.closeTo(10 / 3), expect.closeTo(10 / 3 - 3), 0]);
  const pose = { rotationVector: [0, 0, 0], pivotMm: [0, 0, 0], translationMm: [0, -8, 2], scale: 1 } as const;
  const shownPoses = new Map([["mandible", { ...pose, rotationVector: [0, 0, 0], pivotMm: [0, 0, 0], translationMm: [0, -8, 2] }]]) as ShownFace["shownPoses"];
  expect(shownPoint(shown({ shownPoses }), middle(SEGMENT))).toEqual([expect.closeTo(10 / 3), expect.closeTo(10 / 3 - 8), 2]);
});

test("the nearest point of a surface is found inside, at edges and at corners, and none beyond the reach", () => {
  const at = (point: [number, number, number]) => nearestAnchor(file.surfaces[SKIN], SKIN, point, 2);
  expect(at([2, 3, 1.5])?.distanceMm).toBeCloseTo(1.5, 6);
  expect(at([-1, -1, 0])?.distanceMm).toBeCloseTo(Math.SQRT2, 6);
  expect(at([5, -1, 0])?.distanceMm).toBeCloseTo(1, 6);
  expect(at([5, 5, 2.5])).toBeNull();
});

test("what is not on a surface, on another kind or on the wrong side is refused in a sentence, and nothing changes", () => {
  expect(book.place("pronasale", null)).toMatch(/there is no skin there/);
  expect(book.place("pronasale", middle(SEGMENT))).toMatch(/this is mandible; choose a point on skin/);
  expect(book.place("upper_molar_right", middle(SEGMENT))).toMatch(/the patient’s left side/);
  expect(book.place("no_such", middle(SKIN))).not.toBe("");
  expect(book.placed.size).toBe(0);
  expect(book.canUndo).toBe(false);
  expect(book.place("pronasale", middle(SKIN))).toBe("");
});

test("where the frame is the scanner's the face is measured about the middle of its skin, and no side is refused", async () => {
  file = await openCase(sourceOf(smallCase({ json: ({ extensions }) => (extensions.TISSUEFORM_case.head_frame.source = "scanner") })));
  expect(faceFrame(file).originMm).toEqual([5, 5, 0]);
  expect(new LandmarkBook(file).place("upper_molar_right", middle(SEGMENT))).toBe("");
  expect(faceFrame((file = await openCase(sourceOf(smallCase())))).originMm).toEqual([0, 0, 0]);
});

test("a landmark whose segment the case knows lies on no other one", async () => {
  file = await openCase(sourceOf(smallCase()));
  const other = new LandmarkBook({ ...file, surfaces: file.surfaces.map((surface) => ({ ...surface, entry: { ...surface.entry, handle: "" } })) });
  expect(other.place("pogonion", middle(SEGMENT))).toMatch(/moves with another segment/);
});

test("an upper tooth is not on the segment of the lower one, although it may be the nearest surface", () => {
  const lower = { ...file.manifest.landmarks[0], name: "lower_incisor", handle: "mandible" };
  const met = new LandmarkBook({ ...file, manifest: { ...file.manifest, landmarks: [...file.manifest.landmarks, lower] } });
  for (const name of ["upper_incisor", "upper_midline"]) {
    expect(met.place(name, middle(SEGMENT))).toMatch(/moves with another segment/);
    expect(book.place(name, middle(SEGMENT))).toBe("");
  }
  expect(met.place("lower_midline", middle(SEGMENT))).toBe("");
});

test("suggestions count when they are confirmed, together as one step", () => {
  book.suggest(new Map([["pronasale", middle(SKIN)], ["subnasale", middle(SKIN)]]));
  expect(measureFace(shown()).find(({ definition }) => definition.name === "chin_midline")?.kind).toBe("missing");
  expect(book.suggestions.size).toBe(2);
  book.confirm(["pronasale", "subnasale", "none"]);
  expect([book.placed.size, book.suggestions.size]).toEqual([2, 0]);
  book.undo();
  expect([book.placed.size, book.suggestions.size]).toEqual([0, 2]);
  book.redo();
  expect(book.placed.size).toBe(2);
});

test("what was saved comes back; what is of another case or broken does not", () => {
  book.place("pronasale", middle(SKIN));
  book.place("point_1", middle(SEGMENT));
  book.setOwn([{ landmarks: ["pronasale", "point_1"] }]);
  const saved = JSON.parse(JSON.stringify(book.save()));
  const again = new LandmarkBook(file);
  again.restore(saved);
  expect(again.save()).toEqual(book.save());
  saved.placed[0][1].triangle = 99;
  saved.placed.push(["<script>", middle(SKIN)], ["subnasale", { ...middle(SKIN), weights: [2, -1, 0] }], null);
  again.restore(saved);
  expect(Array.from(again.placed.keys())).toEqual(["point_1"]);
  expect(readAnchor({ surface: 0, triangle: 0, weights: [NaN, 0, 1] }, file.surfaces)).toBeNull();
  again.restore("nothing");
  expect(again.placed.size).toBe(1);
});

test("a measure of one's own goes with its landmark", () => {
  book.place("point_1", middle(SKIN));
  book.place("point_2", middle(SEGMENT));
  book.setOwn([{ landmarks: ["point_1", "point_2"] }]);
  book.remove("point_1");
  expect(book.own).toEqual([]);
});

test("measures for the PACS hold numbers only, with their band where it is known", () => {
  book.place("soft_pogonion", middle(SKIN));
  const bandOf = () => new Float32Array(4).fill(0.4);
  const [measure, ...others] = toMessages(measureFace(shown({ bandOf })));
  expect(others).toEqual([]);
  expect(measure).toMatchObject({ name: "chin_midline", unit: "mm", before: expect.closeTo(10 / 3), lowestAfter: expect.closeTo(10 / 3 - 0.4), highestAfter: expect.closeTo(10 / 3 + 0.4) });
  expect(toMessages(measureFace(shown()))[0].lowestAfter).toBeUndefined();
});

test("the section of a closed surface is one line, and its outline has the foremost point of each level", () => {
  // A box from -5 to 5 to the left, 0 to -20 forward, 0 to 30 up.
  const corners = [-5, 5].flatMap((x) => [0, -20].flatMap((y) => [0, 30].map((z) => [x, y, z])));
  const quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
  const box = { positions: Float32Array.from(corners.flat()), triangles: Uint32Array.from(quads.flatMap(([a, b, c, d]) => [a, b, c, a, c, d])) };
  const lines = cutProfile(box, file.manifest.headFrame);
  expect(lines.length).toBe(1);
  const face = outline(lines);
  expect(face.every(({ forward }) => Math.abs(forward - 20) < 1e-4)).toBe(true);
  expect([face[0].up, face[face.length - 1].up]).toEqual([expect.closeTo(30), expect.closeTo(0)]);
});

test("the profile suggests forehead, fold, lip and chin between what the case knows", () => {
  const profile = [[0, 60], [4, 50], [1, 30], [20, 0], [12, -9], [0, -10], [3, -20], [-6, -24], [2, -30], [-5, -38], [0, -46], [-6, -55], [-40, -62]].map(([forward, up]) => ({ forward, up }));
  const at = (forward: number, up: number) => ({ left: 0, forward, up });
  const known = new Map([["pronasale", at(20, 0)], ["subnasale", at(0, -10)], ["labrale_superius", at(3, -20)], ["labrale_inferius", at(2, -30)], ["soft_pogonion", at(0, -46)]]);
  const found = suggestFromProfile(profile, known);
  expect(Object.fromEntries(found)).toEqual({
    soft_glabella: { forward: 4, up: 50 },
    columella: { forward: 12, up: -9 },
    stomion_superius: { forward: -6, up: -24 },
    sublabiale: { forward: -5, up: -38 },
    soft_menton: { forward: -6, up: -55 },
  });
  expect(suggestFromProfile(profile, new Map()).size).toBe(0);
});

const NOSE = new Map([["pronasale", { left: 0, forward: 20, up: 0 }]]);
const glabellaOf = (points: readonly (readonly [number, number])[]) => suggestFromProfile(points.map(([forward, up]) => ({ forward, up })), NOSE).get("soft_glabella");

test("the forehead is the foremost above the root of the nose, also where the back of the nose stands in front of it", () => {
  expect(glabellaOf([[5, 80], [11, 70], [13, 62], [14, 56], [12, 50], [10, 44], [12, 40], [16, 35], [18, 20], [20, 0]])).toEqual({ forward: 14, up: 56 });
});

test.each([
  // As the bundled head's: a hump of a quarter of a millimetre on a nose behind which the forehead falls back.
  ["the forehead falls back behind a humped nose", [[10.5, 72], [11.3, 64], [12, 55], [15.5, 40], [17.8, 29], [17.6, 26], [18.2, 20], [20, 0]]],
  ["the CT ends below the brows", [[13, 50], [11, 45], [10, 40], [16, 30], [20, 0]]],
  ["what is deepest lies too near the tip to be the root of the nose", [[5, 70], [14, 60], [12, 40], [10, 26], [8, 20], [20, 0]]],
  ["nothing is seen above the nose", [[18, 20], [20, 0]]],
] as const)("no forehead is suggested where %s", (_, points) => {
  expect(glabellaOf(points)).toBeUndefined();
});

test("no fold is suggested where there is next to none between lip and chin", () => {
  const known = new Map([["labrale_inferius", { left: 0, forward: 10, up: -30 }], ["soft_pogonion", { left: 0, forward: 4, up: -50 }]]);
  const fold = (forward: number) => suggestFromProfile([{ forward: 10, up: -30 }, { forward, up: -40 }, { forward: 4, up: -50 }], known).get("sublabiale");
  expect(fold(6.5)).toBeUndefined();
  expect(fold(4)).toEqual({ forward: 4, up: -40 });
});
