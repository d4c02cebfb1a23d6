// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { CaseError, Field } from "./field";

// The container of a case: glTF 2.0 binary, as far as a case uses it.

export const MAX_FILE_BYTES = 512 * 2 ** 20;
export const MAX_JSON_BYTES = 4 * 2 ** 20;
const MAX_VIEWS = 1024;
const MAX_MESHES = 64;
const MAX_VERTICES = 12_000_000;
export const MAX_TRIANGLES = 4_000_000;

const MAGIC = 0x46546c67;
const CHUNK_JSON = 0x4e4f534a;
const CHUNK_BIN = 0x004e4942;
const HEADER_BYTES = 12;
const CHUNK_HEAD_BYTES = 8;

/** How much of a file shows where its JSON ends. */
export const PREFIX_BYTES = HEADER_BYTES + CHUNK_HEAD_BYTES;

const FLOAT32 = 5126;
const UINT32 = 5125;
const TRIANGLES = 4;

/** Bytes of the file, by their place in it. */
export interface Range {
  offset: number;
  length: number;
}

/** A surface's arrays: 12 bytes a vertex and a triangle. */
export interface SurfaceRanges {
  positions: Range;
  triangles: Range;
}

/** What the JSON chunk says of the file, each range checked to lie within the BIN chunk. */
export interface Container {
  views: Range[];
  meshes: SurfaceRanges[];
  /** The extension TISSUEFORM_case. */
  manifest: Field;
}

/** Where the JSON lies, of a file of `totalBytes` that begins with `prefix`. */
export function jsonRange(prefix: Uint8Array, totalBytes: number): Range {
  if (totalBytes > MAX_FILE_BYTES) throw new CaseError(`the file has ${totalBytes} bytes, and a case at most ${MAX_FILE_BYTES}`);
  const head = new DataView(prefix.buffer, prefix.byteOffset, prefix.byteLength);
  if (prefix.length < PREFIX_BYTES || head.getUint32(0, true) !== MAGIC) {
    throw new CaseError("this is not a case file: drop one made by tissueform case pack (.tfcase)");
  }
  if (head.getUint32(4, true) !== 2) throw new CaseError("the file's glTF version is not 2");
  if (head.getUint32(8, true) !== totalBytes) {
    throw new CaseError(`the file states ${head.getUint32(8, true)} bytes and has ${totalBytes}: copy it again`);
  }
  const length = head.getUint32(12, true);
  if (head.getUint32(16, true) !== CHUNK_JSON) throw new CaseError("the file does not begin with JSON");
  if (length > MAX_JSON_BYTES || PREFIX_BYTES + length + CHUNK_HEAD_BYTES > totalBytes) {
    throw new CaseError(`the file's JSON is said to have ${length} bytes, which is more than is there or allowed`);
  }
  return { offset: PREFIX_BYTES, length };
}

/** `json`: of jsonRange; `binHead`: the 8 bytes after it. */
export function readContainer(json: Uint8Array, binHead: Uint8Array, totalBytes: number): Container {
  const bin = binRange(json.length, binHead, totalBytes);
  const root = new Field(parseJson(json), "");
  const views = root.get("bufferViews").list(MAX_VIEWS).map((view) => viewRange(view, bin));
  const accessors = root.get("accessors").list(MAX_VIEWS);
  const meshes = root.get("meshes").list(MAX_MESHES).map((mesh) => surfaceRanges(mesh, accessors, views));
  return { views, meshes, manifest: root.get("extensions").get("TISSUEFORM_case") };
}

function parseJson(json: Uint8Array): unknown {
  try {
    return JSON.parse(new TextDecoder("utf-8", { fatal: true }).decode(json));
  } catch {
    throw new CaseError("the file's JSON cannot be read: copy the file again");
  }
}

function binRange(jsonBytes: number, head: Uint8Array, totalBytes: number): Range {
  const offset = PREFIX_BYTES + jsonBytes + CHUNK_HEAD_BYTES;
  const view = new DataView(head.buffer, head.byteOffset, head.byteLength);
  const length = view.getUint32(0, true);
  if (view.getUint32(4, true) !== CHUNK_BIN || offset + length > totalBytes) {
    throw new CaseError("the file's binary part is missing or incomplete: copy the file again");
  }
  return { offset, length };
}

function viewRange(view: Field, bin: Range): Range {
  view.get("buffer").integer(0, 0);
  const offset = view.get("byteOffset").integerOr(0, 0, bin.length);
  const length = view.get("byteLength").integer(1, bin.length - offset);
  return { offset: bin.offset + offset, length };
}

function surfaceRanges(mesh: Field, accessors: Field[], views: Range[]): SurfaceRanges {
  const primitives = mesh.get("primitives").list(1);
  if (primitives.length !== 1) mesh.get("primitives").fail("a list of one primitive");
  const primitive = primitives[0];
  primitive.get("mode").integerOr(TRIANGLES, TRIANGLES, TRIANGLES);
  const accessor = (field: Field) => accessors[field.integer(0, accessors.length - 1)];
  const positions = accessorRange(accessor(primitive.get("attributes").get("POSITION")), views, "VEC3", MAX_VERTICES);
  const triangles = accessorRange(accessor(primitive.get("indices")), views, "SCALAR", 3 * MAX_TRIANGLES);
  if (triangles.length % 12 !== 0) primitive.get("indices").fail("three a triangle");
  return { positions, triangles };
}

function accessorRange(accessor: Field, views: Range[], type: "VEC3" | "SCALAR", most: number): Range {
  const component = type === "VEC3" ? FLOAT32 : UINT32;
  accessor.get("type").oneOf([type]);
  accessor.get("componentType").integer(component, component);
  const view = views[accessor.get("bufferView").integer(0, views.length - 1)];
  const offset = accessor.get("byteOffset").integerOr(0, 0, view.length);
  const length = accessor.get("count").integer(1, most) * (type === "VEC3" ? 12 : 4);
  if (offset % 4 !== 0 || offset + length > view.length) accessor.fail("within its buffer view");
  return { offset: view.offset + offset, length };
}
