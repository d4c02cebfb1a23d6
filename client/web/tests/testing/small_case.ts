// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { create, toBinary } from "@bufbuild/protobuf";
import type { CaseSource } from "../../src/case/case_file";
import { CreateSessionRequestSchema } from "../../src/generated/tissueform/v1/session_service_pb";

// A small case for tests: a skin of two triangles over a mesh of five vertices, one segment, a fixed bone.

export const MESH_POSITIONS = [0, 0, 0, 10, 0, 0, 0, 10, 0, 0, 0, 10, 10, 10, 10];
export const TETS = [0, 1, 2, 3, 1, 2, 3, 4];
const SKIN = [0, 0, 0, 10, 0, 0, 0, 10, 0, 10, 10, 0];
const TRIANGLES = [0, 1, 2, 1, 3, 2];

/** What a test changes of the file before it is written. */
export interface CaseChanges {
  /** Of the whole JSON. */
  json?: (json: any) => void;
  follows?: number[];
  weights?: number[];
  triangles?: number[];
  handle?: string;
}

/** The bytes of a .tfcase. */
export function smallCase(changes: CaseChanges = {}): Uint8Array<ArrayBuffer> {
  const request = create(CreateSessionRequestSchema, {
    mesh: `meshes/${"a".repeat(64)}`,
    handles: [{ name: changes.handle ?? "mandible", vertices: [0, 1, 2] }],
  });
  const payload = concat([new Float64Array(MESH_POSITIONS), new Int32Array(TETS), new Float64Array(2)]);
  const chunks = [
    new Float32Array(SKIN),
    new Uint32Array(changes.triangles ?? TRIANGLES),
    new Int32Array(changes.follows ?? [0, 1, 2, 1, 2, 3, 2, 3, 4, 0, 0, 0]),
    new Float32Array(changes.weights ?? [1, 0, 0, 0.5, 0.5, 0, 0, 0, 1, 0, 0, 0]),
    toBinary(CreateSessionRequestSchema, request),
    payload,
  ];
  const { views, bin } = layOut(chunks);
  const json = caseJson(views, bin.length);
  changes.json?.(json);
  return container(JSON.stringify(json), bin);
}

export function sourceOf(bytes: Uint8Array<ArrayBuffer>): CaseSource {
  return {
    totalBytes: bytes.length,
    async read(offset, length) {
      if (offset < 0 || length < 0 || offset + length > bytes.length) throw new RangeError(`read of ${length} at ${offset}`);
      return bytes.slice(offset, offset + length);
    },
  };
}

/** A glTF binary of this JSON and binary chunk. */
export function container(json: string, bin: Uint8Array): Uint8Array<ArrayBuffer> {
  const text = new TextEncoder().encode(json.padEnd(4 * Math.ceil(json.length / 4)));
  const out = new Uint8Array(28 + text.length + bin.length);
  const view = new DataView(out.buffer);
  [0x46546c67, 2, out.length, text.length, 0x4e4f534a].forEach((word, i) => view.setUint32(4 * i, word, true));
  out.set(text, 20);
  view.setUint32(20 + text.length, bin.length, true);
  view.setUint32(24 + text.length, 0x004e4942, true);
  out.set(bin, 28 + text.length);
  return out;
}

/** Where each lies in a BIN chunk that holds them all. */
export function layOut(chunks: ArrayBufferView[]): { views: { buffer: number; byteOffset: number; byteLength: number }[]; bin: Uint8Array } {
  const views: { buffer: number; byteOffset: number; byteLength: number }[] = [];
  let end = 0;
  for (const chunk of chunks) {
    const byteOffset = 16 * Math.ceil(end / 16);
    views.push({ buffer: 0, byteOffset, byteLength: chunk.byteLength });
    end = byteOffset + chunk.byteLength;
  }
  const bin = new Uint8Array(4 * Math.ceil(end / 4));
  chunks.forEach((chunk, i) => bin.set(new Uint8Array(chunk.buffer, chunk.byteOffset, chunk.byteLength), views[i].byteOffset));
  return { views, bin };
}

function caseJson(views: unknown[], binBytes: number): unknown {
  const surface = { primitives: [{ attributes: { POSITION: 0 }, indices: 1, mode: 4 }] };
  const handle = {
    name: "mandible",
    label: "Lower jaw",
    pivot_mm: [5, 5, 0],
    pose: { rotation_vector_deg: [0, 0, 0], pivot_mm: [0, 0, 0], translation_mm: [0, -8, 0], scale: 1 },
    limits: { translation_mm: 15, rotation_deg: 20 },
  };
  const manifest = {
    format: "tissueform-case",
    version: 1,
    title: "small",
    notice: "not a medical device",
    provenance: { software: "test", commit: "none", created: "2026-01-01T00:00:00Z", plan_sha256: "" },
    unit: "mm",
    coordinate_system: "LPS",
    mesh: { name: `meshes/${"a".repeat(64)}`, vertex_count: 5, tet_count: 2, cell_arrays: ["tissue"], payload: 5 },
    session_request: 4,
    model: "gradient_field",
    surfaces: [
      { name: "skin", kind: "skin", mesh: 0, follows: { vertices: 2, weights: 3 } },
      { name: "mandible", kind: "segment", mesh: 1, handle: "mandible" },
      { name: "skull", kind: "bone", mesh: 1 },
    ],
    handles: [handle],
    landmarks: [
      { name: "pogonion", label: "Pogonion", position_mm: [5, 0, 0], handle: "mandible" },
      { name: "soft_pogonion", label: "Soft pogonion", position_mm: [0, 0, 0], skin_vertex: 0 },
    ],
    head_frame: { origin_mm: [0, 0, 0], left: [1, 0, 0], posterior: [0, 1, 0], superior: [0, 0, 1], source: "landmarks" },
  };
  return {
    asset: { version: "2.0" },
    buffers: [{ byteLength: binBytes }],
    bufferViews: views,
    accessors: [
      { bufferView: 0, componentType: 5126, count: 4, type: "VEC3" },
      { bufferView: 1, componentType: 5125, count: 6, type: "SCALAR" },
    ],
    meshes: [surface, surface],
    extensionsUsed: ["TISSUEFORM_case"],
    extensions: { TISSUEFORM_case: manifest },
  };
}

export function concat(arrays: ArrayBufferView[]): Uint8Array {
  const out = new Uint8Array(arrays.reduce((sum, array) => sum + array.byteLength, 0));
  let at = 0;
  for (const array of arrays) {
    out.set(new Uint8Array(array.buffer, array.byteOffset, array.byteLength), at);
    at += array.byteLength;
  }
  return out;
}
