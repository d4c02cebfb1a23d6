// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { create } from "@bufbuild/protobuf";
import { expect, test } from "vitest";
import { FitBound, FitResponseSchema } from "../../src/generated/tissueform/v1/plan_service_pb";
import { targetSentences } from "../../src/workbench/target_sentences";

const TARGETS = [{ label: "Chin" }, { label: "Lower lip" }, { label: "Upper lip" }];
const HANDLES = [{ name: "mandible", label: "Lower jaw" }];

test("targets that contradict each other are reported by name, each with what it misses", () => {
  const response = create(FitResponseSchema, {
    converged: true,
    targets: [
      { name: "target 1", reached: false, missedMm: 2.34 },
      { name: "target 2", reached: false, missedMm: 1.5 },
      { name: "target 3", reached: true, missedMm: 0.001 },
    ],
    contradictions: [{ first: "target 1", second: "target 2" }],
  });
  expect(targetSentences(response, TARGETS, HANDLES, 1)).toEqual([
    "Chin: cannot be reached; 2.3 mm are missing.",
    "Lower lip: cannot be reached; 1.5 mm are missing.",
    "Upper lip: reached, within 0.01 mm.",
    "Chin and Lower lip conflict: they require different movements of the same bone.",
  ]);
});

test("a number at its limit, and a search that did not converge, are reported last", () => {
  const response = create(FitResponseSchema, {
    converged: false,
    numbers: [
      { handle: "mandible", isRotation: false, axis: 1, bound: FitBound.HIGHEST },
      { handle: "mandible", isRotation: true, axis: 0, bound: FitBound.UNSPECIFIED },
    ],
  });
  expect(targetSentences(response, TARGETS, HANDLES, 1)).toEqual(["At its limit: Lower jaw to the back.", "The search did not converge; choose a smaller target."]);
  expect(targetSentences(response, TARGETS, HANDLES, 0.8)[0]).toBe("At its limit (the head is oblique in the scan: the search uses 80 % of the case’s limits): Lower jaw to the back.");
});
