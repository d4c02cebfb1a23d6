// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Field } from "../case/field";
import type { BoundPhotograph } from "./photograph_data";

// A photograph in a file that moves: docs/moving-file.md.

export type RowReader = (place: Field, count: number) => Int32Array<ArrayBuffer>;

export const MAX_PHOTOGRAPH_PARTS = 8;
const MOST_ROWS = 4_000_000;
const STEPS_PER_MM = 2048;
const SHARE_STEPS = 65535;

/** The part of the JSON; `add` and `addRows` take bytes and rows of three, and give their number. */
export function writePhotographPart(photograph: BoundPhotograph, add: (bytes: Uint8Array) => number, addRows: (values: ArrayLike<number>, steps: number) => number): object {
  const { positions, drawn, triangles, uv, colors, image, places, weights, offsetsMm } = photograph;
  const looks = Float64Array.from({ length: 3 * drawn.length }, (_, i) => (i % 3 === 2 ? drawn[(i - 2) / 3] / SHARE_STEPS : uv === null ? 0 : uv[2 * Math.floor(i / 3) + (i % 3)]));
  const offsets = Float64Array.from({ length: positions.length }, (_, i) => (i % 3 === 0 ? offsetsMm[i / 3] : 0));
  return {
    points: positions.length / 3,
    vertices: drawn.length,
    triangles: triangles.length / 3,
    positions: addRows(positions, STEPS_PER_MM),
    corners: addRows(triangles, 1),
    looks: addRows(looks, SHARE_STEPS),
    has_uv: uv !== null,
    places: addRows(places, 1),
    weights: addRows(weights, SHARE_STEPS),
    offsets: addRows(offsets, STEPS_PER_MM),
    ...(colors === null ? {} : { colors: addRows(colors, 1) }),
    ...(image === null ? {} : { image: add(image) }),
  };
}

/** Throws an Error where that is not what writePhotographPart gives. */
export function readPhotographPart(field: Field, part: (field: Field) => Uint8Array<ArrayBuffer>, rows: RowReader): BoundPhotograph {
  const [points, vertices, triangles] = ["points", "vertices", "triangles"].map((name) => field.get(name).integer(1, MOST_ROWS));
  const looks = rows(field.get("looks"), vertices);
  const drawn = Uint32Array.from({ length: vertices }, (_, d) => looks[3 * d + 2]);
  const corners = Uint32Array.from(rows(field.get("corners"), triangles));
  if (drawn.some((point) => point >= points) || corners.some((vertex) => vertex >= vertices)) field.get("corners").fail("of vertices that are there");
  const offsets = rows(field.get("offsets"), points);
  return {
    positions: Float32Array.from(rows(field.get("positions"), points), (step) => step / STEPS_PER_MM),
    drawn,
    triangles: corners,
    uv: field.get("has_uv").truth() ? Float32Array.from({ length: 2 * vertices }, (_, i) => looks[3 * Math.floor(i / 2) + (i % 2)] / SHARE_STEPS) : null,
    colors: field.get("colors").isPresent ? Uint8Array.from(rows(field.get("colors"), vertices)) : null,
    image: field.get("image").isPresent ? part(field.get("image")) : null,
    places: Uint32Array.from(rows(field.get("places"), points)),
    weights: Float32Array.from(rows(field.get("weights"), points), (step) => step / SHARE_STEPS),
    offsetsMm: Float32Array.from({ length: points }, (_, v) => offsets[3 * v] / STEPS_PER_MM),
  };
}
