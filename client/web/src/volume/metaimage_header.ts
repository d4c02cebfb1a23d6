// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { norm, scaled, type Vector } from "../geometry/rotation";
import type { Directions } from "./volume";
import { damagedFile, type ValueType, type VolumeHeader } from "./volume_header";

const TYPES: Readonly<Record<string, ValueType>> = {
  MET_CHAR: "int8", MET_UCHAR: "uint8", MET_SHORT: "int16", MET_USHORT: "uint16", MET_INT: "int32", MET_UINT: "uint32",
  MET_LONG_LONG: "int64", MET_ULONG_LONG: "uint64", MET_FLOAT: "float32", MET_DOUBLE: "float64",
};
const HEADER_BYTES = 64 * 1024;

function numbers(text: string | undefined, count: number): number[] {
  const values = (text ?? "").trim().split(/\s+/).map(Number);
  if (values.length !== count || !values.every(Number.isFinite)) throw damagedFile();
  return values;
}

function geometryOf(field: (...names: string[]) => string | undefined) {
  const stated = field("AnatomicalOrientation") ?? "";
  if (stated.length !== 3 || stated.includes("?")) {
    throw new Error("the file does not say how it lies in the patient (MetaImage without \"AnatomicalOrientation\"); export it again, or state \"axes\" in a recipe of the command line");
  }
  const matrix = numbers(field("TransformMatrix", "Rotation", "Orientation") ?? "1 0 0 0 1 0 0 0 1", 9);
  const axes = [0, 3, 6].map((at): Vector => [matrix[at], matrix[at + 1], matrix[at + 2]]);
  return {
    spacing: numbers(field("ElementSpacing", "ElementSize") ?? "1 1 1", 3) as Vector,
    origin: numbers(field("Offset", "Position", "Origin") ?? "0 0 0", 3) as Vector,
    directions: axes.map((axis) => scaled(axis, 1 / norm(axis))) as unknown as Directions,
  };
}

export async function readMetaImageHeader(file: Blob): Promise<VolumeHeader> {
  const text = new TextDecoder("latin1").decode(await file.slice(0, HEADER_BYTES).arrayBuffer());
  const end = /ElementDataFile\s*=\s*(\S+)[^\n]*\n/.exec(text);
  if (end === null) throw damagedFile();
  if (end[1].toUpperCase() !== "LOCAL") throw new Error("the MetaImage names a data file beside it; save it as one .mha");
  const fields = new Map([...text.slice(0, end.index).matchAll(/^\s*(\w+)\s*=\s*(.*?)\s*$/gm)].map(([, key, value]) => [key, value]));
  const field = (...names: string[]) => names.map((name) => fields.get(name)).find((value) => value !== undefined);
  const isTrue = (value: string | undefined) => value !== undefined && /^(true|1)$/i.test(value);
  if (field("NDims") !== "3" || (field("ElementNumberOfChannels") ?? "1") !== "1") throw new Error("the MetaImage is not one volume with one number a voxel; export the volume alone");
  const type = TYPES[field("ElementType") ?? ""];
  const size = numbers(field("DimSize"), 3);
  if (type === undefined || !size.every((count) => Number.isInteger(count) && count > 0)) throw damagedFile();
  return {
    grid: { size: size as [number, number, number], ...geometryOf(field) }, type, littleEndian: !isTrue(field("BinaryDataByteOrderMSB", "ElementByteOrderMSB")),
    packing: isTrue(field("CompressedData")) ? "deflate" : "raw", dataOffset: end.index + end[0].length, skip: 0, slope: 1, intercept: 0, names: new Map(),
  };
}
