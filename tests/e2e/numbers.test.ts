// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { type CaseFile, openCase } from "../../client/web/src/case/case_file";
import { type ExportedPlan, exportedSurfaces, planDocument } from "../../client/web/src/exports/plan_export";
import { ProfileDrawing } from "../../client/web/src/exports/profile_svg";
import type { Prediction } from "../../client/web/src/generated/tissueform/v1/prediction_pb";
import { DeformationModel } from "../../client/web/src/generated/tissueform/v1/session_pb";
import type { Pose } from "../../client/web/src/geometry/pose";
import { type ShownFace, landmarkMovements, measureFace, suggestLandmarks } from "../../client/web/src/measures/face_measures";
import { LandmarkBook } from "../../client/web/src/measures/landmark_book";
import { cell } from "../../client/web/src/planning/landmarks";
import { MOVE_KEYS, Plan } from "../../client/web/src/planning/plan";
import { Head } from "../../client/web/src/scene/head";
import { FaceColors, pick } from "../../client/web/src/workbench/face_colors";
import type { ShownAnswer } from "../../client/web/src/workbench/shown_answer";
import { Signal } from "../../client/web/src/workbench/signal";
import type { Workbench } from "../../client/web/src/workbench/workbench";
import { sourceOf } from "../../client/web/tests/testing/small_case";

// The planner's numbers of the bundled real heads, at rest and in ten random plans, against PredictCase of C++. The displacements
// of the mesh are those of C++, so that nothing but what the planner makes of them is compared.

const SOURCE = fileURLToPath(new URL("../..", import.meta.url));
const BIN = join(process.env.TISSUEFORM_BUILD_DIR ?? join(SOURCE, "build/release"), "bin");
const MOST_OFF = 0.01;
const PLANS = 10;

interface Movement {
  name: string;
  [component: string]: number | string;
}

/** What C++ says of one plan. */
interface Reference {
  landmarks: Movement[];
  segments: Movement[];
  displacements: Float32Array;
  /** Of each surface, moved. */
  surfaces: Float32Array[];
}

/** The same random numbers in each run: a linear congruential generator, 0 to 1. */
function random(seed: number): () => number {
  let state = seed;
  return () => (state = (Math.imul(state, 1664525) + 1013904223) >>> 0) / 2 ** 32;
}

/** At rest, then random within half of the case's limits. */
function makePlans(file: CaseFile): Plan[] {
  const next = random(29);
  return Array.from({ length: PLANS + 1 }, (_, index) => {
    const plan = new Plan(file);
    if (index === 0) return plan;
    plan.handles.forEach((__, handle) => plan.change(handle, Object.fromEntries(MOVE_KEYS.map((key) => [key, (next() - 0.5) * plan.limit(handle, key)])), true));
    return plan;
  });
}

const rowOf = ({ rotationVector, pivotMm, translationMm, scale }: Pose) => [...rotationVector, ...pivotMm, ...translationMm, scale];

function askReference(folder: string, planPath: string, file: CaseFile, plans: readonly Plan[]): Reference[] {
  const path = (name: string) => join(folder, name);
  writeFileSync(path("poses.json"), JSON.stringify(plans.map((plan) => plan.poses().map(rowOf))));
  execFileSync(join(BIN, "tissueform-predicted-case"), [planPath, path("poses.json"), path("numbers.json"), path("numbers.f32")]);
  const bytes = readFileSync(path("numbers.f32"));
  const floats = new Float32Array(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length));
  let begin = 0;
  const take = (count: number) => floats.subarray(begin, (begin += count));
  const numbers = JSON.parse(readFileSync(path("numbers.json"), "utf8")) as Pick<Reference, "landmarks" | "segments">[];
  return numbers.map((of) => ({ ...of, displacements: take(3 * file.manifest.mesh.vertexCount), surfaces: file.surfaces.map(({ positions }) => take(positions.length)) }));
}

/** All landmarks that are suggested, a distance and an angle of one's own. */
function measuredLandmarks(file: CaseFile): LandmarkBook {
  const book = new LandmarkBook(file);
  book.suggest(suggestLandmarks(file, book));
  const names = Array.from(book.suggestions.keys());
  book.confirm(names);
  book.setOwn([{ landmarks: names.slice(0, 2) }, { landmarks: names.slice(-3) }]);
  return book;
}

/** The head as the planner draws it, and the face as its panels and exports are given it. */
function pageOf(file: CaseFile, landmarks: LandmarkBook, plan: Plan, { displacements }: Reference): { head: Head; face: ExportedPlan; largestMm: number } {
  const head = new Head(file);
  const followed = pick(displacements, file.followed);
  const shownPoses = new Map(plan.handles.map(({ name }, index) => [name, plan.poses()[index]]));
  head.setDisplacements(followed);
  head.setPoses(shownPoses);
  const face: ExportedPlan = {
    file, landmarks, plan, shownPoses,
    positionsOf: (surface: number) => head.surfaces[surface].shape.positions,
    bandOf: () => null,
    showsPlan: true,
    caseName: "cases/bundled",
    model: new Signal<DeformationModel>(DeformationModel.GRADIENT_FIELD),
    modelInfo: () => undefined,
    answer: new Signal<ShownAnswer | null>(null),
    stored: { all: new Signal<readonly Prediction[]>([]) },
  };
  return { head, face, largestMm: new FaceColors(head).showLengths("", followed).largestMm };
}

/** The face whose surfaces are where C++ puts them. */
function faceOf(file: CaseFile, landmarks: LandmarkBook, { surfaces }: Reference): ShownFace {
  return { file, landmarks, positionsOf: (surface) => surfaces[surface], shownPoses: new Map(), bandOf: () => null, showsPlan: true };
}

/** As much of a document as a drawing needs: it becomes the attributes of its elements, in order. */
function drawnNumbers(face: ShownFace): number[] {
  const attributes: string[] = [];
  const element = { setAttribute: (_: string, value: string) => attributes.push(value), append: () => {} };
  vi.stubGlobal("document", { createElementNS: () => element });
  new ProfileDrawing(face).draw();
  vi.unstubAllGlobals();
  return attributes.flatMap((text) => Array.from(text.matchAll(/-?\d+(\.\d+)?/g), ([number]) => Number(number)));
}

function largestDifference(a: ArrayLike<number>, b: ArrayLike<number>): number {
  expect(a.length).toBe(b.length);
  let largest = 0;
  for (let i = 0; i < a.length; ++i) largest = Math.max(largest, Math.abs(a[i] - b[i]));
  return largest;
}

function expectMovement(actual: Record<string, unknown>, expected: Movement): void {
  for (const [component, value] of Object.entries(expected)) {
    if (typeof value === "number") expect(Math.abs((actual[component] as number) - value), `${expected.name} ${component}`).toBeLessThan(MOST_OFF);
  }
}

function largestMovement(file: CaseFile, { surfaces }: Reference): number {
  const skins = surfaces.filter((_, index) => file.surfaces[index].entry.kind === "skin");
  const rests = file.surfaces.filter(({ entry }) => entry.kind === "skin").map(({ positions }) => positions);
  const lengths = skins.flatMap((skin, s) => Array.from({ length: skin.length / 3 }, (_, v) => Math.hypot(...[0, 1, 2].map((k) => skin[3 * v + k] - rests[s][3 * v + k]))));
  return lengths.reduce((most, length) => Math.max(most, length), 0);
}

describe.each(["head", "three_segments"])("the bundled case %s", (name) => {
  const folder = mkdtempSync(join(tmpdir(), "tissueform-numbers-"));
  afterAll(() => rmSync(folder, { recursive: true, force: true }));
  let file: CaseFile;
  let landmarks: LandmarkBook;
  let plans: Plan[];
  let references: Reference[];

  beforeAll(async () => {
    const plan = join(SOURCE, "tests/data/plans", name, "plan.json");
    execFileSync(join(BIN, "tissueform"), ["case", "pack", plan, "--out", join(folder, "case.tfcase")]);
    file = await openCase(sourceOf(new Uint8Array(readFileSync(join(folder, "case.tfcase")))));
    landmarks = measuredLandmarks(file);
    plans = makePlans(file);
    references = askReference(folder, plan, file, plans);
  });

  test("at rest no row of the movements table has a number", () => {
    const { face, largestMm } = pageOf(file, landmarks, plans[0], references[0]);
    const movements = landmarkMovements(face);
    expect(movements.length).toBeGreaterThan(5);
    expect(movements.some((_, index) => file.manifest.landmarks[index].skinVertex !== null)).toBe(true);
    for (const { label, forwardMm, leftMm, upMm, totalMm } of movements) {
      expect([forwardMm, leftMm, upMm, totalMm].map(cell), label).toEqual(["·", "·", "·", "·"]);
      expect(totalMm, label).toBeLessThan(1e-6);
    }
    expect(largestMm).toBeLessThan(1e-6);
  });

  test("movements of landmarks and segments are those of C++", () => {
    plans.forEach((plan, index) => {
      const { face } = pageOf(file, landmarks, plan, references[index]);
      const planner = JSON.parse(planDocument(face, { measures: measureFace(face), movements: null }));
      references[index].landmarks.forEach((expected, l) => {
        expect(planner.landmarks[l].name).toBe(expected.name);
        expectMovement(planner.landmarks[l], expected);
        expectMovement({ ...landmarkMovements(face)[l] }, expected);
      });
      references[index].segments.forEach(({ totalMm, ...expected }, s) => expectMovement(planner.segments[s].move_about_plan_pivot, expected as Movement));
    });
    expect(references.at(-1)?.landmarks.filter(({ totalMm }) => (totalMm as number) > 0.5).length).toBeGreaterThan(3);
  });

  test("measures, the profile and the surfaces are those of C++", () => {
    plans.forEach((plan, index) => {
      const { head, face, largestMm } = pageOf(file, landmarks, plan, references[index]);
      const expected = faceOf(file, landmarks, references[index]);
      const planner = JSON.parse(planDocument(face, { measures: measureFace(face), movements: null }));
      const values = measureFace(expected).flatMap((result) => (result.kind === "value" ? [result] : []));
      expect(values.length).toBeGreaterThan(2);
      expect(planner.measures.map((measure: Movement) => measure.name)).toEqual(values.map(({ definition }) => definition.name));
      values.forEach(({ before, after }, m) => expect(largestDifference([planner.measures[m].before, planner.measures[m].after], [before, after])).toBeLessThan(MOST_OFF));
      // The drawing has two decimals: numbers that differ by less may be one step apart.
      expect(largestDifference(drawnNumbers(face), drawnNumbers(expected))).toBeLessThan(1.1 * MOST_OFF);
      const exported = exportedSurfaces({ view: { head }, bandOf: face.bandOf } as unknown as Workbench, "all");
      exported.forEach(({ positions }, s) => expect(largestDifference(positions, references[index].surfaces[s]), file.surfaces[s].entry.name).toBeLessThan(MOST_OFF));
      expect(Math.abs(largestMm - largestMovement(file, references[index]))).toBeLessThan(MOST_OFF);
      head.dispose();
    });
  });
});
