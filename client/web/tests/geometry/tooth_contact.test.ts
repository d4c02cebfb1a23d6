// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { expect, test } from "vitest";
import type { Pose } from "../../src/geometry/pose";
import { type Teeth, ToothContact } from "../../src/geometry/tooth_contact";

const SIDE = 11;
const STEP_MM = 0.5;

/** A square sheet of 5 mm that faces up, or down. */
function sheet(up: number, isUp: boolean, handle: string): Teeth {
  const positions = new Float32Array(3 * SIDE * SIDE);
  const triangles: number[] = [];
  for (let i = 0; i < SIDE; ++i) {
    for (let j = 0; j < SIDE; ++j) {
      positions.set([STEP_MM * i, STEP_MM * j, up], 3 * (SIDE * i + j));
      if (i === SIDE - 1 || j === SIDE - 1) continue;
      const a = SIDE * i + j;
      const quad = [a, a + SIDE, a + SIDE + 1, a, a + SIDE + 1, a + 1];
      triangles.push(...(isUp ? quad : quad.reverse()));
    }
  }
  return { positions, triangles: Uint32Array.from(triangles), handle };
}

const shift = (up: number): ReadonlyMap<string, Pose> => new Map([["mandible", { rotationVector: [0, 0, 0], pivotMm: [1, 2, 3], translationMm: [0, 0, up], scale: 1 }]]);
const bite = () => new ToothContact([sheet(2, false, "")], [sheet(0, true, "mandible")]);

test("teeth that lie apart have a gap and no contact", () => {
  const contact = bite().find(shift(0));
  expect(contact).toMatchObject({ areaMm2: 0, deepestMm: 0, leastMm: expect.closeTo(2, 5) });
  expect(contact.upperMm[0].every((mm) => Math.abs(mm - 2) < 1e-5)).toBe(true);
  expect(bite().find(shift(-8)).leastMm).toBeNull();
});

test("teeth that are brought together touch with all their area, and further in lie in each other", () => {
  expect(bite().find(shift(2))).toMatchObject({ areaMm2: expect.closeTo(25, 5), deepestMm: expect.closeTo(0, 5), leastMm: expect.closeTo(0, 5) });
  const contact = bite().find(shift(2.4));
  expect(contact.deepestMm).toBeCloseTo(0.4, 5);
  expect(contact.lowerMm[0].every((mm) => Math.abs(mm + 0.4) < 1e-5)).toBe(true);
});
