// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Grid } from "./volume";

export const TYPES = ["int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64", "float32", "float64"] as const;
export type ValueType = (typeof TYPES)[number];
export type Packing = "raw" | "gzip" | "deflate";

/** What the header of a volume file states. */
export interface VolumeHeader {
  readonly grid: Grid;
  readonly type: ValueType;
  readonly littleEndian: boolean;
  readonly packing: Packing;
  /** Where in the file the packed bytes begin. */
  readonly dataOffset: number;
  /** Bytes to leave out after unpacking (NIfTI's header). */
  readonly skip: number;
  /** value = slope * stored + intercept. */
  readonly slope: number;
  readonly intercept: number;
  /** Names of labels, where the file has some. */
  readonly names: ReadonlyMap<number, string>;
}

/** Headers are shorter than this, with the names of many segments. */
export const HEADER_BYTES = 2 ** 20;

export const damagedFile = () => new Error("the file is truncated, damaged, or not of its ending's format; export it again");

/** The first `count` bytes of a packed file. Throws when it has fewer, and reads no more. */
export async function unpackedBytes(file: Blob, packing: Packing, count: number): Promise<Uint8Array<ArrayBuffer>> {
  if (packing === "raw") {
    if (file.size < count) throw damagedFile();
    return new Uint8Array(await file.slice(0, count).arrayBuffer());
  }
  const out = new Uint8Array(count);
  const reader = file.stream().pipeThrough(new DecompressionStream(packing)).getReader();
  let at = 0;
  try {
    while (at < count) {
      const { done, value } = await reader.read();
      if (done) break;
      out.set(value.subarray(0, count - at), at);
      at += Math.min(value.length, count - at);
    }
  } catch {
    throw damagedFile();
  } finally {
    reader.cancel().catch(() => {});
  }
  if (at < count) throw damagedFile();
  return out;
}

/** A name as a list can show it, as PrintableName of core/imaging/labels. */
export function printableName(name: string): string {
  return name.trim().slice(0, 40).replace(/[^ !#-~]/g, "?");
}
