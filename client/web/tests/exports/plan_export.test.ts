// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { create } from "@bufbuild/protobuf";
import { expect, test } from "vitest";
import { openCase } from "../../src/case/case_file";
import { type ExportedPlan, planDocument } from "../../src/exports/plan_export";
import { SolveSummarySchema } from "../../src/generated/tissueform/v1/deform_service_pb";
import type { Prediction } from "../../src/generated/tissueform/v1/prediction_pb";
import { DeformationModel } from "../../src/generated/tissueform/v1/session_pb";
import { measureFace } from "../../src/measures/face_measures";
import { LandmarkBook } from "../../src/measures/landmark_book";
import { Plan } from "../../src/planning/plan";
import type { ShownAnswer } from "../../src/workbench/shown_answer";
import { Signal } from "../../src/workbench/signal";
import { smallCase, sourceOf } from "../testing/small_case";

const FORWARD_MM = 4;

/** The jaw forward, the skin a millimetre to the left, and a chin whose midline is measured. */
async function exported(changes: Partial<ExportedPlan> = {}) {
  const file = await openCase(sourceOf(smallCase()));
  const [plan, landmarks] = [new Plan(file), new LandmarkBook(file)];
  plan.change(0, { forwardMm: FORWARD_MM }, true);
  landmarks.place("soft_pogonion", { surface: 0, triangle: 0, weights: [1, 0, 0] });
  const bench: ExportedPlan = {
    file,
    plan,
    landmarks,
    caseName: "cases/a",
    model: new Signal<DeformationModel>(DeformationModel.UNSPECIFIED),
    modelInfo: () => undefined,
    answer: new Signal<ShownAnswer | null>(null),
    stored: { all: new Signal<readonly Prediction[]>([]) },
    shownPoses: new Map([["mandible", plan.poses()[0]]]),
    positionsOf: (surface) => file.surfaces[surface].positions.map((value, i) => value + (i % 3 === 0 ? 1 : 0)),
    bandOf: () => new Float32Array(4).fill(0.25),
    showsPlan: true,
    ...changes,
  };
  return JSON.parse(planDocument(bench, { measures: measureFace(bench), movements: null }));
}

test("the plan's face goes along with its numbers and their band", async () => {
  const document = await exported();
  expect(document.segments[0].move.forwardMm).toBe(FORWARD_MM);
  expect(document.landmarks).toMatchObject([{ name: "pogonion", forwardMm: FORWARD_MM }, { name: "soft_pogonion", leftMm: 1, band_95_mm: 0.25 }]);
  expect(document.measures).toMatchObject([{ name: "chin_midline", before: 0, after: 1, lowest_after: expect.closeTo(0.75), highest_after: expect.closeTo(1.25), interval_of: "material" }]);
  expect(document).not.toHaveProperty("left_out");
});

test("of another face there is no number beside the plan's, and the file says so", async () => {
  const document = await exported({ showsPlan: false });
  expect(document.segments[0].move.forwardMm).toBe(FORWARD_MM);
  expect(document.measurement_landmarks.placed.length).toBe(1);
  expect(document.left_out).toMatch(/^landmarks, measures and answer: the face that is shown is not the plan's/);
  for (const name of ["landmarks", "measures", "answer"]) expect(document).not.toHaveProperty(name);
});

test.each<[string, ShownAnswer | null, object | null]>([
  ["no answer", null, null],
  ["a bound", { by: "server", isRefining: false, summary: create(SolveSummarySchema, { prepared: true, errorBoundMm: 0.02 }) }, { given_by: "server", error_bound_mm: 0.02, error_estimate_mm: null }],
  ["an estimate", { by: "server", isRefining: true, summary: create(SolveSummarySchema, { prepared: true, errorEstimateMm: 0.4 }) }, { refining: true, error_bound_mm: null, error_estimate_mm: 0.4 }],
  ["one that was not reached", { by: "server", isRefining: false, summary: create(SolveSummarySchema, { load: 0.6 }) }, { converged: false, load: 0.6, error_bound_mm: null, error_estimate_mm: null }],
  ["the page's own", { by: "page", errorBoundMm: 0.3, isEstimate: true }, { given_by: "page", error_bound_mm: null, error_estimate_mm: 0.3 }],
])("the answer is that of the face: %s", async (_, answer, facts) => {
  const document = await exported({ answer: new Signal(answer) });
  if (facts === null) expect(document.answer).toBeNull();
  else expect(document.answer).toMatchObject(facts);
});
