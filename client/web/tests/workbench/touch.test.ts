// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { expect, test } from "vitest";
import { openCase } from "../../src/case/case_file";
import { followedRest } from "../../src/workbench/face_colors";
import { TouchReader, type Touch } from "../../src/workbench/touch";
import { handMadeCase } from "../testing/hand_made_case";
import { sourceOf } from "../testing/small_case";

async function handMade() {
  const file = await openCase(sourceOf(handMadeCase(true)));
  const rest = followedRest(file);
  const lips = file.sessionRequest.contact.filter(({ bilateral }) => !bilateral);
  const placeOf = (vertex: number) => file.followed.indexOf(vertex);
  return { reader: new TouchReader(file, rest), rest, lips, placeOf };
}

test("of rows without a force it says that nothing presses, and how far the lips are apart", async () => {
  const { reader, rest, lips, placeOf } = await handMade();
  const displacements = new Float32Array(rest.length);
  displacements.set([3, 0, -4], 3 * placeOf(lips[7].vertex));
  const touch = reader.read(displacements, new Float32Array(lips.length));
  expect(touch).toMatchObject({ rowCount: lips.length, pressingCount: 0, mostN: 0, lipsApartMm: 4, points: [] });
});

test("where it presses are points at their moved places, the strongest brightest", async () => {
  const { reader, rest, lips, placeOf } = await handMade();
  const displacements = new Float32Array(rest.length);
  const place = placeOf(lips[2].vertex);
  displacements.set([1, 2, 3], 3 * place);
  const forces = new Float32Array(lips.length);
  forces.set([0.25, 0, 0.5]);
  const { pressingCount, mostN, points, colors } = reader.read(displacements, forces) as Touch;
  expect([pressingCount, mostN]).toEqual([2, 0.5]);
  expect(points[1]).toEqual([0, 1, 2].map((axis) => rest[3 * place + axis] + axis + 1));
  const brightness = [0, 3].map((at) => colors[at] + colors[at + 1] + colors[at + 2]);
  expect(brightness[1]).toBeGreaterThan(brightness[0]);
});

test("with areas the colors are those of pressures", async () => {
  const { reader, rest, lips } = await handMade();
  const forces = new Float32Array(lips.length);
  forces.set([0.25, 0.5, 0.5]);
  const areas = new Float64Array(lips.length).fill(100);
  areas.set([20, 50, 0]);
  const { mostN, pressureKpa, colors } = reader.read(new Float32Array(rest.length), forces, areas) as Touch;
  expect(mostN).toBe(0.5);
  expect(pressureKpa).toEqual({ most: 12.5, mean: 750 / 70 });
  const brightness = [0, 3, 6].map((at) => colors[at] + colors[at + 1] + colors[at + 2]);
  expect(brightness[0]).toBeGreaterThan(brightness[1]);
  expect(brightness[1]).toBeGreaterThan(brightness[2]);
});

test("forces of other rows say nothing", async () => {
  const { reader, rest } = await handMade();
  expect(reader.read(new Float32Array(rest.length), new Float32Array(3))).toBeNull();
});
