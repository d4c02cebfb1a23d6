// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { norm, scaled, type Vector } from "../geometry/rotation";
import type { Directions } from "./volume";
import { damagedFile, HEADER_BYTES, printableName, type Packing, type ValueType, type VolumeHeader } from "./volume_header";

const TYPE_NAMES: Readonly<Record<string, ValueType>> = {
  "signed char": "int8", int8: "int8", int8_t: "int8", uchar: "uint8", "unsigned char": "uint8", uint8: "uint8", uint8_t: "uint8",
  short: "int16", "short int": "int16", "signed short": "int16", "signed short int": "int16", int16: "int16", int16_t: "int16",
  ushort: "uint16", "unsigned short": "uint16", "unsigned short int": "uint16", uint16: "uint16", uint16_t: "uint16",
  int: "int32", "signed int": "int32", int32: "int32", int32_t: "int32", uint: "uint32", "unsigned int": "uint32", uint32: "uint32", uint32_t: "uint32",
  longlong: "int64", "long long": "int64", int64: "int64", int64_t: "int64", ulonglong: "uint64", "unsigned long long": "uint64", uint64: "uint64", uint64_t: "uint64",
  float: "float32", double: "float64",
};
/** Signs that turn the axes of a space into those of LPS. */
const SPACES: Readonly<Record<string, Vector>> = {
  "left-posterior-superior": [1, 1, 1], lps: [1, 1, 1],
  "right-anterior-superior": [-1, -1, 1], ras: [-1, -1, 1],
  "left-anterior-superior": [1, -1, 1], las: [1, -1, 1],
};
const PACKINGS: Readonly<Record<string, Packing>> = { raw: "raw", gzip: "gzip", gz: "gzip" };

function vectorsOf(text: string, count: number): Vector[] {
  const vectors = [...text.matchAll(/\(([^()]*)\)/g)].map(([, inner]) => inner.split(",").map(Number));
  if (vectors.length !== count || !vectors.every((v) => v.length === 3 && v.every(Number.isFinite))) throw damagedFile();
  return vectors as Vector[];
}

function namesOf(fields: ReadonlyMap<string, string>): Map<number, string> {
  const names = new Map<number, string>();
  for (const [key, name] of fields) {
    const segment = /^(Segment\d+)_Name$/.exec(key)?.[1];
    const value = Number(fields.get(`${segment}_LabelValue`));
    if (segment !== undefined && Number.isInteger(value)) names.set(value, printableName(name));
  }
  return names;
}

function sizesOf(fields: ReadonlyMap<string, string>): [number, number, number] {
  const sizes = (fields.get("sizes") ?? "").split(/\s+/).map(Number);
  if (sizes.length === 4) throw new Error(`the file holds ${sizes[0]} layers or volumes; export one, without overlapping segments`);
  if (sizes.length !== 3 || !sizes.every((size) => Number.isInteger(size) && size > 0)) throw damagedFile();
  return sizes as [number, number, number];
}

/** Fields "key: value" and pairs "key:=value". */
function fieldsOf(text: string): Map<string, string> {
  const fields = new Map<string, string>();
  for (const line of text.split(/\r?\n/).slice(1)) {
    const found = line.startsWith("#") ? null : /^([^:]+):(=| )(.*)$/.exec(line);
    if (found !== null) fields.set(found[1].trim(), found[3].trim());
  }
  return fields;
}

function geometryOf(fields: ReadonlyMap<string, string>): { spacing: Vector; origin: Vector; directions: Directions } {
  const space = (fields.get("space") ?? "").toLowerCase();
  const signs = SPACES[space];
  if (signs === undefined) throw new Error("the file does not say how it lies in the patient (NRRD without \"space\" LPS, RAS or LAS); export it again, or state \"axes\" in a recipe of the command line");
  const toLps = (v: Vector): Vector => [v[0] * signs[0], v[1] * signs[1], v[2] * signs[2]];
  const steps = vectorsOf(fields.get("space directions") ?? "", 3).map(toLps);
  const spacing = steps.map(norm) as Vector;
  const [origin] = fields.has("space origin") ? vectorsOf(fields.get("space origin")!, 1).map(toLps) : [[0, 0, 0] as Vector];
  return { spacing, origin, directions: steps.map((step, i) => scaled(step, 1 / spacing[i])) as unknown as Directions };
}

export async function readNrrdHeader(file: Blob): Promise<VolumeHeader> {
  const start = new Uint8Array(await file.slice(0, HEADER_BYTES).arrayBuffer());
  const text = new TextDecoder("latin1").decode(start);
  const end = /\r?\n\r?\n/.exec(text);
  if (!text.startsWith("NRRD") || end === null) throw damagedFile();
  const fields = fieldsOf(text.slice(0, end.index));
  if (fields.has("data file") || fields.has("datafile")) throw new Error("the NRRD names a data file beside it; save it as one file, with the data in it");
  const type = TYPE_NAMES[(fields.get("type") ?? "").toLowerCase()];
  const packing = PACKINGS[(fields.get("encoding") ?? "").toLowerCase()];
  if (type === undefined) throw damagedFile();
  if (packing === undefined) throw new Error("the NRRD has an encoding other than raw or gzip; save it with gzip");
  const size = sizesOf(fields);
  return {
    grid: { size, ...geometryOf(fields) }, type, packing, dataOffset: end.index + end[0].length, skip: 0, slope: 1, intercept: 0,
    littleEndian: fields.get("endian") !== "big", names: namesOf(fields),
  };
}
