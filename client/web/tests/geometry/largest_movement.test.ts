// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { expect, test } from "vitest";
import { largestMovement, largestOf } from "../../src/geometry/largest_movement";

const numbers = (...values: number[]) => Float32Array.from(values);

test("the band of the largest movement reaches as far as that of any vertex", () => {
  // The second may move by 7, the third by no less than 4.5, whichever is the largest then.
  expect(largestMovement(numbers(5, 4, 4.75), numbers(1, 3, 0.25))).toEqual({ largestMm: 5, band: { lowestMm: 4.5, highestMm: 7 } });
  expect(largestMovement(numbers(5, 4), numbers(0.5, 0.5))).toEqual({ largestMm: 5, band: { lowestMm: 4.5, highestMm: 5.5 } });
  expect(largestMovement(numbers(0.5), numbers(2)).band).toEqual({ lowestMm: 0, highestMm: 2.5 });
  expect(largestMovement(numbers(5, 4), null)).toEqual({ largestMm: 5, band: null });
});

test("of several skins the largest counts, and a band only where all have one", () => {
  const [one, other] = [largestMovement(numbers(5), numbers(1)), largestMovement(numbers(4.75), numbers(0.25))];
  expect(largestOf([one, other])).toEqual({ largestMm: 5, band: { lowestMm: 4.5, highestMm: 6 } });
  expect(largestOf([one, largestMovement(numbers(6), null)])).toEqual({ largestMm: 6, band: null });
  expect(largestOf([])).toEqual({ largestMm: 0, band: null });
});
