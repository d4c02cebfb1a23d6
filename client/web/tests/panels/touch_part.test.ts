// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { expect, test } from "vitest";
import { describeSeal } from "../../src/panels/touch_part";

test("what a seal does is said, and that it is posture", () => {
  expect(describeSeal(0, null)).toBe("");
  expect(describeSeal(29, null)).toBe(" A seal holds the edges of the lips at one height: posture, not mechanics.");
  expect(describeSeal(29, { partedMm: 2.24, released: false })).toBe(" A seal holds the edges of the lips, which would be up to 2.2 mm apart in height, at one height: posture, not mechanics.");
});

test("a seal that is released holds nothing", () => {
  expect(describeSeal(29, { partedMm: 13.04, released: true })).toBe(" The seal of the lips is released: their edges are 13.0 mm apart in height.");
});
