// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type MessageInitShape, create } from "@bufbuild/protobuf";
import { expect, test } from "vitest";
import { SolveSummarySchema } from "../../src/generated/tissueform/v1/deform_service_pb";
import { PredictionSchema } from "../../src/generated/tissueform/v1/prediction_pb";
import { type ShownAnswer, describeAnswer, describeFace } from "../../src/workbench/shown_answer";

function server(summary: MessageInitShape<typeof SolveSummarySchema>, isRefining = false): ShownAnswer {
  return { by: "server", summary: create(SolveSummarySchema, summary), isRefining };
}

const PREPARED = server({ prepared: true, errorBoundMm: 0.034 });

test.each<[string, ShownAnswer | null, string]>([
  ["none", null, ""],
  ["prepared", PREPARED, "Prepared answer, within 0.03 mm of the full one."],
  ["refining", server({ prepared: true, errorEstimateMm: 0.42 }, true), "Estimate, within about 0.42 mm; the full answer follows."],
  ["an estimate that nothing refines", server({ prepared: true, errorEstimateMm: 0.42 }), "Estimate, within about 0.42 mm; the full answer follows."],
  ["still iterated", server({ converged: true, load: 1 }, true), "An early answer without an error estimate; a better one follows."],
  ["not converged", server({ load: 0.6, obstacle: "the chin meets the upper lip" }), "The full answer was not reached (60 % of the move): the chin meets the upper lip."],
  ["not converged, nobody knows why", server({ load: 1 }), "The full answer was not reached (100 % of the move)."],
  ["full", server({ converged: true, load: 1 }), "Full answer."],
  ["the page's own", { by: "page", errorBoundMm: 0.001, isEstimate: false }, "Prepared answer, within 0.01 mm of the full one."],
  ["the page's own estimate", { by: "page", errorBoundMm: 0.7, isEstimate: true }, "Estimate, within about 0.70 mm; the full answer follows."],
])("%s", (_, answer, text) => {
  expect(describeAnswer(answer)).toBe(text);
});

test("a comparison is described by the face that it shows", () => {
  const to = create(PredictionSchema, { name: "predictions/to", summary: { converged: false, load: 0.5 } });
  const other = create(PredictionSchema, { name: "predictions/other" });
  const text = (from: "plan" | "rest" | typeof other, share: number) => describeFace(PREPARED, { from, to, share });
  expect(text("plan", 1)).toBe("A stored prediction. The full answer was not reached (50 % of the move).");
  expect(text(other, 0)).toBe("A stored prediction.");
  expect(text("plan", 0)).toBe(describeAnswer(PREPARED));
  expect(text("rest", 0)).toBe("Pre-op face.");
  expect(text("plan", 0.5)).toBe("Between two faces: not an answer of a model.");
});
