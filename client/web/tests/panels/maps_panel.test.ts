// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { expect, test } from "vitest";
import type { LocalState } from "../../src/live/local_answers";
import { describeLocal, largestText, modelText } from "../../src/panels/maps_panel";

type Ready = Extract<LocalState, { kind: "ready" }>;
const READY: Ready = { kind: "ready", place: "page", hasWorkers: true, coverage: "covered" };

test.each<[string, Partial<Ready>, string]>([
  ["nothing lacks", {}, "This page answers at once; the server confirms."],
  ["no workers", { hasWorkers: false }, "This page answers at once (without a background thread: slower); the server confirms."],
  ["beyond the columns", { coverage: "beyond" }, "Outside the prepared range: the server answers."],
])("the text names what answers the hand: %s", (_, change, text) => {
  expect(describeLocal({ ...READY, ...change })).toBe(text);
});

test("the largest movement is shown with its band where that is known", () => {
  expect(largestText({ largestMm: 8.123, band: { lowestMm: 7.5, highestMm: 8.8 } })).toBe("largest 8.12 mm, 95 % interval (stiffness only) 7.50 to 8.80");
  expect(largestText({ largestMm: 8.123, band: null })).toBe("largest 8.12 mm");
});

test.each([
  ["gradient_field", /^Geometric, not mechanical: .*no forces/],
  ["arap", /rigid motion.*corotational elastic solid without Poisson effect/],
  ["linear_elastic", /^Linear finite elements: Hooke’s law, small strains and rotations/],
  ["neo_hookean", /^Nonlinear finite elements: hyperelastic tissue, large deformations/],
])("%s is described by its mechanics", (name, words) => {
  expect(modelText(name).text).toMatch(words);
  expect(modelText(name).text).not.toMatch(/spring|keeps its volume/);
});
