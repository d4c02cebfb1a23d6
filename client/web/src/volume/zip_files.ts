// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { Inflate } from "fflate";
import type { DroppedFile } from "./opened_ct";

// The directory of a zip is read from its end, and each file is unpacked when it is read. Limits as docs/ct-input.md, but of a page's memory.

const MAX_ENTRIES = 20_000;
const MAX_UNPACKED_BYTES = 2 ** 32;
const MAX_RATIO = 500;
const RATIO_FROM_BYTES = 64 * 2 ** 20;
const END_BYTES = 22;
const END_SIGNATURE = 0x06054b50;
const ENTRY_SIGNATURE = 0x02014b50;
const ENTRY_BYTES = 46;
const LOCAL_SIGNATURE = 0x04034b50;
const LOCAL_BYTES = 30;
const STORED = 0;
const DEFLATED = 8;

interface Entry {
  readonly path: string;
  readonly method: number;
  readonly packed: number;
  readonly unpacked: number;
  readonly offset: number;
}

const damaged = () => new Error("the zip is truncated or damaged; pack the folder again");

async function viewOf(zip: Blob, from: number, to: number): Promise<DataView> {
  return new DataView(await zip.slice(from, to).arrayBuffer());
}

async function findDirectory(zip: Blob): Promise<{ offset: number; bytes: number }> {
  const from = Math.max(0, zip.size - END_BYTES - 0xffff);
  const end = await viewOf(zip, from, zip.size);
  for (let at = end.byteLength - END_BYTES; at >= 0; --at) {
    if (end.getUint32(at, true) !== END_SIGNATURE) continue;
    const entries = end.getUint16(at + 10, true);
    const offset = end.getUint32(at + 16, true);
    if (entries === 0xffff || offset === 0xffffffff) throw new Error("the zip is larger than 4 GiB or has more than 65,535 files; unpack it and drop the folder of one series");
    return { offset, bytes: end.getUint32(at + 12, true) };
  }
  throw damaged();
}

function checkEntry(flags: number, method: number, path: string): void {
  if ((flags & 1) !== 0) throw new Error("the zip is encrypted; unpack it and drop the folder");
  if (path.startsWith("/") || path.includes("\\") || path.split("/").includes("..")) throw new Error("the zip has a file outside of its folder; pack the folder again");
  if (method !== STORED && method !== DEFLATED) throw new Error(`the zip uses the method ${method}; pack the folder with deflate, or drop the folder`);
  if (/\.zip$/i.test(path)) throw new Error("the zip holds another zip; unpack it and drop the folder");
}

const isForgotten = (path: string) => path.endsWith("/") || path.startsWith("__MACOSX/") || /(^|\/)(\.DS_Store|Thumbs\.db|desktop\.ini)$/.test(path);

function entriesIn(directory: DataView): Entry[] {
  const entries: Entry[] = [];
  for (let at = 0; at < directory.byteLength;) {
    if (at + ENTRY_BYTES > directory.byteLength || directory.getUint32(at, true) !== ENTRY_SIGNATURE) throw damaged();
    const pathBytes = directory.getUint16(at + 28, true);
    if (at + ENTRY_BYTES + pathBytes > directory.byteLength) throw damaged();
    const path = new TextDecoder().decode(new Uint8Array(directory.buffer, directory.byteOffset + at + ENTRY_BYTES, pathBytes));
    const method = directory.getUint16(at + 10, true);
    if (!isForgotten(path)) {
      checkEntry(directory.getUint16(at + 8, true), method, path);
      entries.push({ path, method, packed: directory.getUint32(at + 20, true), unpacked: directory.getUint32(at + 24, true), offset: directory.getUint32(at + 42, true) });
    }
    at += ENTRY_BYTES + pathBytes + directory.getUint16(at + 30, true) + directory.getUint16(at + 32, true);
  }
  return entries;
}

function checkTotal(entries: readonly Entry[], zipBytes: number): void {
  const total = entries.reduce((sum, entry) => sum + entry.unpacked, 0);
  if (total > MAX_UNPACKED_BYTES) throw new Error(`the zip unpacks to ${total} bytes; at most ${MAX_UNPACKED_BYTES} are read: pack one series`);
  if (total > RATIO_FROM_BYTES && total > MAX_RATIO * zipBytes) throw new Error(`the zip unpacks to more than ${MAX_RATIO} times its size; drop the folder instead`);
}

/** Never more than the directory states, regardless of the packed bytes. */
function inflated(packed: Uint8Array, size: number): Uint8Array<ArrayBuffer> {
  const out = new Uint8Array(size);
  let at = 0;
  const inflate = new Inflate((chunk) => {
    if (at + chunk.length > size) throw damaged();
    out.set(chunk, at);
    at += chunk.length;
  });
  const step = 64 * 1024;
  for (let from = 0; from < packed.length; from += step) inflate.push(packed.subarray(from, from + step), from + step >= packed.length);
  if (at !== size) throw damaged();
  return out;
}

async function unpacked(zip: Blob, entry: Entry): Promise<Blob> {
  const local = await viewOf(zip, entry.offset, entry.offset + LOCAL_BYTES);
  if (local.byteLength < LOCAL_BYTES || local.getUint32(0, true) !== LOCAL_SIGNATURE) throw damaged();
  const from = entry.offset + LOCAL_BYTES + local.getUint16(26, true) + local.getUint16(28, true);
  const packed = zip.slice(from, from + entry.packed);
  if (packed.size !== entry.packed) throw damaged();
  if (entry.method === STORED) return packed;
  try {
    return new Blob([inflated(new Uint8Array(await packed.arrayBuffer()), entry.unpacked)]);
  } catch {
    throw damaged();
  }
}

/** The files of a zip. */
export async function filesOfZip(zip: Blob, onProgress: (share: number) => void, signal?: AbortSignal): Promise<DroppedFile[]> {
  const { offset, bytes } = await findDirectory(zip);
  if (offset + bytes > zip.size) throw damaged();
  const entries = entriesIn(await viewOf(zip, offset, offset + bytes));
  if (entries.length > MAX_ENTRIES) throw new Error(`the zip holds ${entries.length} files; at most ${MAX_ENTRIES} are read: pack one series`);
  if (entries.length === 0) throw new Error("the zip is empty; pack the folder again");
  checkTotal(entries, zip.size);
  const files: DroppedFile[] = [];
  for (const entry of entries) {
    signal?.throwIfAborted();
    files.push({ path: entry.path, file: await unpacked(zip, entry) });
    onProgress(files.length / entries.length);
  }
  return files;
}
