// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { Field } from "../case/field";
import { type HandleEntry, MAX_HANDLES, MAX_SURFACES, SURFACE_KINDS, type SurfaceKind, readHandle, readHeadFrame } from "../case/manifest";
import type { Following } from "../geometry/following_surface";
import type { HeadFrame } from "../geometry/pose";
import type { BoundPhotograph } from "./photograph_data";
import { type RowReader, MAX_PHOTOGRAPH_PARTS, readPhotographPart, writePhotographPart } from "./photograph_rows";
import { packRows, unpackRows } from "./integer_rows";

// What a file that moves holds before it is compressed: docs/moving-file.md. tissueform export writes the same.

export interface MovingSurface {
  name: string;
  kind: SurfaceKind;
  /** "" where it does not move with one. */
  handle: string;
  /** #V by 3, mm, LPS. */
  positions: Float32Array<ArrayBuffer>;
  /** #T by 3, each below #V. */
  triangles: Uint32Array<ArrayBuffer>;
  /** Places in the list of vertices that the answers give; null: does not follow. */
  follows: Following | null;
}

export interface MovingHandle extends HandleEntry {
  /** Whether it has sliders; the others stay in the plan's pose. */
  isFree: boolean;
}

/** No name, date or identifier: what is not here is not in the file. */
export interface MovingData {
  /** "" unless the user gave one. */
  title: string;
  software: string;
  model: string;
  headFrame: HeadFrame;
  handles: MovingHandle[];
  surfaces: MovingSurface[];
  /** Prepared answers as they travel (docs/prepared-answers.md). */
  answers: Uint8Array<ArrayBuffer>;
  /** Of the patient, where the user wants it in the file; null: none. */
  photograph: BoundPhotograph | null;
}

const MAGIC = "TFMOVING";
const VERSION = 1;
const HEAD_BYTES = 16;
const ALIGNMENT = 16;
const STEPS_PER_MM = 2048;
const WEIGHT_STEPS = 65535;
const MOST_JSON_BYTES = 1 << 20;
const MOST_PARTS = 4 * MAX_SURFACES + 1 + MAX_PHOTOGRAPH_PARTS;
const MOST_ROWS = 4_000_000;

export const NOT_A_DEVICE = "not a medical device";

/** Half a step away from zero goes up, as in C++. */
const rounded = (value: number) => Math.floor(value + 0.5);

/** The bytes, not compressed. */
export function writeMovingData(data: MovingData): Uint8Array<ArrayBuffer> {
  const parts: Uint8Array[] = [];
  const add = (part: Uint8Array) => parts.push(part) - 1;
  const addRows = (values: ArrayLike<number>, steps: number) => add(packRows(Int32Array.from(values, (value) => rounded(value * steps))));
  const surfaces = data.surfaces.map(({ name, kind, handle, positions, triangles, follows }) => ({
    name,
    kind,
    ...(handle === "" ? {} : { handle }),
    vertices: positions.length / 3,
    triangles: triangles.length / 3,
    positions: addRows(positions, STEPS_PER_MM),
    corners: addRows(triangles, 1),
    ...(follows === null ? {} : { follows: { places: addRows(follows.places, 1), weights: addRows(follows.weights, WEIGHT_STEPS) } }),
  }));
  const json = {
    format: "tissueform-moving-file",
    version: VERSION,
    notice: NOT_A_DEVICE,
    title: data.title,
    software: data.software,
    model: data.model,
    unit: "mm",
    coordinate_system: "LPS",
    head_frame: frameToJson(data.headFrame),
    handles: data.handles.map(handleToJson),
    surfaces,
    answers: add(data.answers),
    ...(data.photograph === null ? {} : { photograph: writePhotographPart(data.photograph, add, addRows) }),
    parts: parts.map((part) => part.length),
  };
  return layOut(new TextEncoder().encode(JSON.stringify(json)), parts);
}

function frameToJson(frame: HeadFrame) {
  const { originMm, left, posterior, superior, source } = frame;
  return { origin_mm: originMm, left, posterior, superior, source };
}

function handleToJson({ name, label, pivotMm, pose, limits, isFree }: MovingHandle) {
  return {
    name,
    label,
    pivot_mm: pivotMm,
    pose: { rotation_vector_deg: pose.rotationVectorDeg, pivot_mm: pose.pivotMm, translation_mm: pose.translationMm, scale: pose.scale },
    limits: { translation_mm: limits.translationMm, rotation_deg: limits.rotationDeg },
    free: isFree,
  };
}

const aligned = (offset: number) => ALIGNMENT * Math.ceil(offset / ALIGNMENT);

function layOut(json: Uint8Array, parts: Uint8Array[]): Uint8Array<ArrayBuffer> {
  let end = aligned(HEAD_BYTES + json.length);
  const offsets = parts.map((part) => {
    const offset = end;
    end = aligned(end + part.length);
    return offset;
  });
  const out = new Uint8Array(end);
  out.set(new TextEncoder().encode(MAGIC));
  const head = new DataView(out.buffer);
  head.setUint32(8, VERSION, true);
  head.setUint32(12, json.length, true);
  out.set(json, HEAD_BYTES);
  parts.forEach((part, i) => out.set(part, offsets[i]));
  return out;
}

/** Throws an Error where that is not what writeMovingData gives. */
export function readMovingData(bytes: Uint8Array<ArrayBuffer>): MovingData {
  const { root, part } = openParts(bytes);
  root.get("format").oneOf(["tissueform-moving-file"]);
  const handles = root.get("handles").list(MAX_HANDLES).map((field) => ({ ...readHandle(field), isFree: field.get("free").truth() }));
  const names = handles.map((handle) => handle.name);
  return {
    title: root.get("title").text(),
    software: root.get("software").text(),
    model: root.get("model").text(),
    headFrame: readHeadFrame(root.get("head_frame")),
    handles,
    surfaces: root.get("surfaces").list(MAX_SURFACES).map((field) => readSurface(field, names, part)),
    answers: part(root.get("answers")),
    photograph: root.get("photograph").isPresent ? readPhotographPart(root.get("photograph"), part, rowsOf(part)) : null,
  };
}

type PartReader = (field: Field) => Uint8Array<ArrayBuffer>;

function openParts(bytes: Uint8Array<ArrayBuffer>): { root: Field; part: PartReader } {
  const head = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const magic = bytes.length < HEAD_BYTES ? "" : new TextDecoder().decode(bytes.subarray(0, 8));
  if (magic !== MAGIC || head.getUint32(8, true) !== VERSION) throw new Error("the data has another format than this page");
  const length = head.getUint32(12, true);
  if (length > MOST_JSON_BYTES || HEAD_BYTES + length > bytes.length) throw new Error("the data is incomplete");
  const root = new Field(JSON.parse(new TextDecoder().decode(bytes.subarray(HEAD_BYTES, HEAD_BYTES + length))), "");
  let end = aligned(HEAD_BYTES + length);
  const parts = root.get("parts").list(MOST_PARTS).map((field) => {
    const begin = end;
    const size = field.integer(0, bytes.length - begin);
    end = aligned(begin + size);
    return bytes.slice(begin, begin + size);
  });
  return { root, part: (field) => parts[field.integer(0, parts.length - 1)] };
}

const rowsOf = (part: PartReader): RowReader => (place, count) => unpackRows(part(place), count) ?? place.fail("as long as its numbers say");

function readSurface(field: Field, handles: string[], part: PartReader): MovingSurface {
  const vertices = field.get("vertices").integer(1, MOST_ROWS);
  const rows = rowsOf(part);
  const triangles = Uint32Array.from(rows(field.get("corners"), field.get("triangles").integer(1, MOST_ROWS)));
  if (triangles.some((vertex) => vertex >= vertices)) field.get("corners").fail("of vertices that are there");
  const follows = field.get("follows");
  return {
    name: field.get("name").text(),
    kind: field.get("kind").oneOf(SURFACE_KINDS),
    handle: field.get("handle").isPresent ? field.get("handle").oneOf(handles) : "",
    positions: Float32Array.from(rows(field.get("positions"), vertices), (step) => step / STEPS_PER_MM),
    triangles,
    follows: !follows.isPresent
      ? null
      : {
          places: Uint32Array.from(rows(follows.get("places"), vertices)),
          weights: Float32Array.from(rows(follows.get("weights"), vertices), (step) => step / WEIGHT_STEPS),
        },
  };
}
