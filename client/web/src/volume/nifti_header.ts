// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { dot, norm, scaled, type Vector } from "../geometry/rotation";
import type { Directions, Grid } from "./volume";
import { damagedFile, HEADER_BYTES, printableName, unpackedBytes, type ValueType, type VolumeHeader } from "./volume_header";

// NIfTI-1 in one file. Its places are RAS, ours are LPS.

const BYTES = 348;
const TYPES: Readonly<Record<number, ValueType>> = { 2: "uint8", 4: "int16", 8: "int32", 16: "float32", 64: "float64", 256: "int8", 512: "uint16", 768: "uint32", 1024: "int64", 1280: "uint64" };
/** Millimeters, by the low bits of xyzt_units; unknown is taken as millimeters. */
const UNITS: Readonly<Record<number, number>> = { 0: 1, 1: 1000, 2: 1, 3: 0.001 };
/** Farther apart, the two forms of a file say different things. */
const SAME_PLACE_MM = 0.1;
/** Of unit vectors: rounding; a real shear is more. */
const SQUARE = 1e-2;

/** Columns: a step along i, j, k, and the place of the first voxel. */
type Form = readonly [Vector, Vector, Vector, Vector];

function sformOf(view: DataView, littleEndian: boolean): Form {
  const at = (row: number, column: number) => view.getFloat32(280 + 4 * (4 * row + column), littleEndian);
  const column = (c: number): Vector => [at(0, c), at(1, c), at(2, c)];
  return [column(0), column(1), column(2), column(3)];
}

/** A turn by a quaternion of length 1 whose real part is not stored; pixdim[0] < 0 mirrors k. */
function qformOf(view: DataView, littleEndian: boolean): Form {
  const at = (offset: number) => view.getFloat32(offset, littleEndian);
  const [b, c, d] = [at(256), at(260), at(264)];
  const a = Math.sqrt(Math.max(0, 1 - b * b - c * c - d * d));
  const mirror = at(76) < 0 ? -1 : 1;
  return [
    scaled([a * a + b * b - c * c - d * d, 2 * (b * c + a * d), 2 * (b * d - a * c)], at(80)),
    scaled([2 * (b * c - a * d), a * a + c * c - b * b - d * d, 2 * (c * d + a * b)], at(84)),
    scaled([2 * (b * d + a * c), 2 * (c * d - a * b), a * a + d * d - b * b - c * c], at(88) * mirror),
    [at(268), at(272), at(276)],
  ];
}

function formOf(view: DataView, littleEndian: boolean, size: Grid["size"]): Form {
  const hasQform = view.getInt16(252, littleEndian) > 0;
  const hasSform = view.getInt16(254, littleEndian) > 0;
  if (!hasQform && !hasSform) throw new Error("the file does not say how it lies in the patient (NIfTI with qform_code and sform_code 0); export it again, or state \"axes\" in a recipe of the command line");
  if (!hasSform) return qformOf(view, littleEndian);
  const form = sformOf(view, littleEndian);
  if (!hasQform) return form;
  const other = qformOf(view, littleEndian);
  const apart = form.reduce((sum, column, c) => sum + (size[c] ?? 1) * Math.hypot(...column.map((x, i) => x - other[c][i])), 0);
  if (apart > SAME_PLACE_MM) throw new Error("the file's qform and sform place it differently; find out which one is right and set the code of the other to 0");
  return form;
}

function gridOf(form: Form, millimeters: number, size: Grid["size"]): Grid {
  const [i, j, k, origin] = form.map(([x, y, z]): Vector => scaled([-x, -y, z], millimeters));
  const spacing: Vector = [norm(i), norm(j), norm(k)];
  const directions = [i, j, k].map((step, axis) => scaled(step, 1 / spacing[axis])) as unknown as Directions;
  const worst = Math.max(Math.abs(dot(directions[0], directions[1])), Math.abs(dot(directions[0], directions[2])), Math.abs(dot(directions[1], directions[2])));
  if (worst > SQUARE) throw new Error("the file's axes are not square to each other; resample it upright");
  return { size, spacing, origin, directions };
}

/** Names of a label table in the header's extension, as TotalSegmentator writes them. */
function namesOf(extension: Uint8Array): Map<number, string> {
  const text = new TextDecoder("latin1").decode(extension);
  const names = new Map<number, string>();
  for (const [, key, name] of text.matchAll(/<Label [^>]*Key="(\d+)"[^>]*>(?:<!\[CDATA\[)?([^<\]]*)/g)) names.set(Number(key), printableName(name));
  return names;
}

function sizeOf(view: DataView, littleEndian: boolean): [number, number, number] {
  const dim = (axis: number) => view.getInt16(40 + 2 * axis, littleEndian);
  const axes = dim(0);
  for (let axis = 4; axis <= axes; ++axis) {
    if (dim(axis) > 1) throw new Error(`the file holds ${dim(axis)} volumes; extract the one to use`);
  }
  const size: [number, number, number] = [dim(1), dim(2), dim(3)];
  if (axes < 3 || axes > 7 || !size.every((count) => count > 0)) throw damagedFile();
  return size;
}

export async function readNiftiHeader(file: Blob): Promise<VolumeHeader> {
  const magic = new Uint8Array(await file.slice(0, 2).arrayBuffer());
  const packing = magic[0] === 0x1f && magic[1] === 0x8b ? "gzip" : "raw";
  const bytes = await unpackedBytes(file, packing, BYTES);
  const view = new DataView(bytes.buffer);
  const littleEndian = view.getInt32(0, true) === BYTES;
  if ((!littleEndian && view.getInt32(0, false) !== BYTES) || String.fromCharCode(...bytes.subarray(344, 347)) !== "n+1") throw damagedFile();
  const type = TYPES[view.getInt16(70, littleEndian)];
  if (type === undefined) throw new Error("the file holds colors or complex numbers; a CT has one number a voxel");
  const size = sizeOf(view, littleEndian);
  const skip = view.getFloat32(108, littleEndian);
  if (!(Number.isInteger(skip) && skip >= BYTES && skip <= HEADER_BYTES)) throw damagedFile();
  const slope = view.getFloat32(112, littleEndian);
  const millimeters = UNITS[view.getUint8(123) & 7] ?? 1;
  return {
    grid: gridOf(formOf(view, littleEndian, size), millimeters, size), type, littleEndian, packing, dataOffset: 0, skip,
    slope: slope === 0 ? 1 : slope, intercept: slope === 0 ? 0 : view.getFloat32(116, littleEndian),
    names: namesOf((await unpackedBytes(file, packing, skip)).subarray(BYTES)),
  };
}
