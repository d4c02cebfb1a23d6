// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { scaled } from "../geometry/rotation";
import type { Grid, LabelMap, Volume } from "./volume";

// What leaves the page: geometry and values.

/** Compressed and reported in pieces, so that the page stays alive. */
const PIECE_BYTES = 2 ** 20;

const vector = (v: readonly number[]) => `(${v.join(",")})`;

function headerOf(type: string, { size, spacing, origin, directions }: Grid, isLabels: boolean): string {
  return [
    "NRRD0004",
    `type: ${type}`,
    "dimension: 3",
    "space: left-posterior-superior",
    `sizes: ${size.join(" ")}`,
    `space directions: ${directions.map((direction, i) => vector(scaled(direction, spacing[i]))).join(" ")}`,
    ...(isLabels ? [] : ["kinds: domain domain domain"]),
    ...(type === "uint8" ? [] : ["endian: little"]),
    "encoding: gzip",
    `space origin: ${vector(origin)}`,
  ].join("\n");
}

/** Segments of layer 0, as 3D Slicer writes them: their names are what the file said of structures. */
function segmentLines(names: LabelMap["names"]): string {
  return [...names].map(([value, name], i) => `\nSegment${i}_ID:=Segment_${value}\nSegment${i}_Name:=${name.replace(/[\r\n]+/g, " ")}\nSegment${i}_LabelValue:=${value}\nSegment${i}_Layer:=0`).join("");
}

function pieces(bytes: Uint8Array<ArrayBuffer>, onProgress: (share: number) => void): ReadableStream<Uint8Array<ArrayBuffer>> {
  let at = 0;
  return new ReadableStream({
    pull(controller) {
      if (at >= bytes.length) return controller.close();
      controller.enqueue(bytes.subarray(at, at + PIECE_BYTES));
      at += PIECE_BYTES;
      onProgress(Math.min(1, at / bytes.length));
    },
  });
}

async function nrrd(header: string, values: Int16Array | Uint8Array | Uint16Array, onProgress: (share: number) => void): Promise<Blob> {
  const bytes = new Uint8Array(values.buffer as ArrayBuffer, values.byteOffset, values.byteLength);
  const packed = await new Response(pieces(bytes, onProgress).pipeThrough(new CompressionStream("gzip"))).blob();
  return new Blob([`${header}\n\n`, packed], { type: "application/octet-stream" });
}

/** The volume as a file: gzip, int16, LPS; nothing except geometry and values. */
export function nrrdOf(volume: Volume, onProgress: (share: number) => void): Promise<Blob> {
  return nrrd(headerOf("int16", volume.grid, false), volume.values, onProgress);
}

/** The label map as a file: geometry, numbers, and the names of the numbers. */
export function nrrdOfLabels(labels: LabelMap): Promise<Blob> {
  const type = labels.values instanceof Uint8Array ? "uint8" : "uint16";
  return nrrd(headerOf(type, labels.grid, true) + segmentLines(labels.names), labels.values, () => {});
}
