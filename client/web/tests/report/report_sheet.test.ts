// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { create } from "@bufbuild/protobuf";
import { expect, test } from "vitest";
import { SolveSummarySchema } from "../../src/generated/tissueform/v1/deform_service_pb";
import { PredictionSchema } from "../../src/generated/tissueform/v1/prediction_pb";
import { type ModelInfo, ModelInfoSchema } from "../../src/generated/tissueform/v1/server_info_pb";
import { DeformationModel } from "../../src/generated/tissueform/v1/session_pb";
import { MEASURES } from "../../src/measures/definitions";
import type { Band, MeasureResult } from "../../src/measures/evaluation";
import { answerLine, intervalLine } from "../../src/report/report_sheet";
import type { Comparison } from "../../src/workbench/comparison";
import type { ShownAnswer } from "../../src/workbench/shown_answer";
import { Signal } from "../../src/workbench/signal";

const NAMES: Partial<Record<DeformationModel, string>> = { [DeformationModel.NEO_HOOKEAN]: "neo_hookean", [DeformationModel.LINEAR_ELASTIC]: "linear_elastic" };

function line(answer: ShownAnswer | null, comparison: Comparison | null = null): string {
  return answerLine({
    answer: new Signal(answer),
    comparison: new Signal(comparison),
    model: new Signal<DeformationModel>(DeformationModel.NEO_HOOKEAN),
    modelInfo: (model): ModelInfo => create(ModelInfoSchema, { model, name: NAMES[model] }),
  });
}

const OWN: ShownAnswer = { by: "page", errorBoundMm: 0.3, isEstimate: true };

test("an estimate is labeled as one, and as computed by the page", () => {
  const summary = create(SolveSummarySchema, { prepared: true, errorEstimateMm: 0.4 });
  expect(line({ by: "server", summary, isRefining: true })).toBe("model neo_hookean. Estimate, within about 0.40 mm; the full answer follows.");
  expect(line(OWN)).toBe("model neo_hookean. Estimate, within about 0.30 mm; the full answer follows. Computed by the page; not yet confirmed by the server.");
  expect(line(null)).toBe("model neo_hookean. No answer yet.");
});

test("a stored face is described by its own model and answer, independently of the plan's", () => {
  const to = create(PredictionSchema, { model: DeformationModel.LINEAR_ELASTIC, summary: { converged: true, load: 1 } });
  expect(line(OWN, { from: "plan", to, share: 1 })).toBe("model linear_elastic. A stored prediction. Full answer.");
  expect(line(OWN, { from: "plan", to, share: 0 })).toMatch(/^model neo_hookean\. Estimate.* Computed by the page/);
});

test("the report says what its intervals hold, or why there are none", () => {
  const result = (band: Band | null): MeasureResult => ({ definition: MEASURES[0], kind: "value", before: 0, after: 1, band });
  expect(intervalLine([result(null), result({ lowest: 0, highest: 2, parts: { source: "published", surgery: 1, model: 0.5, material: null } })], "")).toBe("95 % interval: surgery and model together, with deviations of surgery and model: published");
  expect(intervalLine([result({ lowest: 0, highest: 2 })], "")).toBe("95 % interval, material uncertainty only; excludes model and surgical error");
  expect(intervalLine([result(null)], "the model is not elastic")).toBe("no 95 % interval: the model is not elastic");
});
