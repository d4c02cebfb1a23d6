// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { expect, test } from "vitest";
import { factsOf, parseReport } from "../../src/building/build_report";

const report = (more: object) => parseReport(new TextEncoder().encode(JSON.stringify({
  ready: true,
  quality: [],
  cautions: [],
  segments: [{ name: "jaw", planes: [] }, { name: "chin", planes: [{}, {}] }],
  metal: { looked_for: false, found: false },
  coverage: { whole: { covered_share: 0.997 } },
  ...more,
})));

test("a plan from a CT is described by the CT", () => {
  expect(factsOf(report({ input: { format: "DICOM", ct_sha256: "0" } }))).toEqual([
    "The model has 99.7 % of the CT's skin.",
    "No metal was found.",
    "jaw was given as a surface.",
    "chin was cut by 2 planes.",
  ]);
});

test("a plan from surfaces names them and no CT's skin or metal", () => {
  expect(factsOf(report({ input: { format: "surfaces", surfaces: ["skin", "skull", "lower jaw"] } }))).toEqual([
    "Built from surfaces, without a CT: skin, skull, lower jaw.",
    "The model has 99.7 % of the given skin.",
    "jaw was given as a surface.",
    "chin was cut by 2 planes.",
  ]);
});

test("an older report, without an input, is read", () => {
  expect(factsOf(report({}))[1]).toBe("No metal was found.");
});
