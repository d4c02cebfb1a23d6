// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { expect, test } from "vitest";
import type { CaseFile } from "../../src/case/case_file";
import { openCase } from "../../src/case/case_file";
import { contactAreas } from "../../src/case/contact_areas";
import { handMadeCase } from "../testing/hand_made_case";
import { sourceOf } from "../testing/small_case";

const SIDE = 3;
const KUHN = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];

interface Normal {
  x: number;
  y: number;
  z: number;
}

/** A layer of cubes of 2 mm, six tets each, with a row at every vertex of its underside. */
function layer(normal: Normal): CaseFile {
  const places = [0, 1].flatMap((z) => Array.from({ length: (SIDE + 1) ** 2 }, (_, i) => [i % (SIDE + 1), Math.floor(i / (SIDE + 1)), z]));
  const vertexAt = ([x, y, z]: number[]) => z * (SIDE + 1) ** 2 + y * (SIDE + 1) + x;
  const tets = Array.from({ length: SIDE ** 2 }, (_, i) => [i % SIDE, Math.floor(i / SIDE), 0]).flatMap((cube) =>
    KUHN.flatMap((axes) => {
      const corner = [...cube];
      return [vertexAt(corner), ...axes.map((axis) => (corner[axis]++, vertexAt(corner)))];
    }),
  );
  const bytes = new Uint8Array([
    ...new Uint8Array(Float64Array.from(places.flat(), (place) => 2 * place).buffer),
    ...new Uint8Array(Int32Array.from(tets).buffer),
  ]);
  const contact = Array.from({ length: (SIDE + 1) ** 2 }, (_, vertex) => ({ vertex, normal, bilateral: false }));
  const file = {
    manifest: { mesh: { vertexCount: places.length, tetCount: tets.length / 4 } },
    sessionRequest: { contact: [...contact, { vertex: 5, normal, bilateral: true }] },
    meshPayload: { offset: 0, length: bytes.length },
    meshSource: { size: bytes.length, read: (from: number, length: number) => Promise.resolve(bytes.slice(from, from + length)) },
  };
  return file as unknown as CaseFile;
}

const sum = (values: Float64Array) => values.reduce((all, value) => all + value, 0);

test("areas of the rows of a flat surface add up to it, and an inner vertex has its share", async () => {
  const areas = await contactAreas(layer({ x: 0, y: 0, z: 1 }));
  expect(areas).toHaveLength((SIDE + 1) ** 2);
  expect(sum(areas)).toBeCloseTo((2 * SIDE) ** 2, 12);
  expect(areas[SIDE + 2]).toBeCloseTo(4, 12);
});

test("areas are seen along the normal, and what faces away has none", async () => {
  expect(sum(await contactAreas(layer({ x: 0, y: 0, z: -1 })))).toBe(0);
  const tilted = await contactAreas(layer({ x: 0, y: 0.6, z: 0.8 }));
  expect(tilted[SIDE + 2]).toBeCloseTo(4 * 0.8, 12);
});

test("every place of the lips of a case has an area", async () => {
  const file = await openCase(sourceOf(handMadeCase(true)));
  const areas = await contactAreas(file);
  expect(areas).toHaveLength(file.sessionRequest.contact.filter(({ bilateral }) => !bilateral).length);
  expect(Math.min(...areas)).toBeGreaterThan(0);
});
