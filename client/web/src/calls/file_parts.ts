// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { toCallError } from "./call_error";
import { steady } from "./steady";

/** A part of a file, as the server sends it. */
export interface FilePart {
  readonly offset: bigint;
  readonly data: Uint8Array;
  readonly totalBytes: bigint;
}

/** A file that comes in parts. Rejects with a CallError; also when parts are missing, or it is larger than `mostBytes`. */
export async function readParts(start: (signal: AbortSignal) => AsyncIterable<FilePart>, what: string, mostBytes: number, onProgress: (share: number) => void = () => {}): Promise<Blob> {
  const parts: Uint8Array<ArrayBuffer>[] = [];
  let [done, total] = [0, 0];
  try {
    for await (const { data, offset, totalBytes } of steady(start)) {
      total = Number(totalBytes);
      if (Number(offset) !== done || total > mostBytes) throw new Error(`the server sent ${what} out of order or too large`);
      parts.push(data as Uint8Array<ArrayBuffer>);
      done += data.length;
      onProgress(total === 0 ? 1 : done / total);
    }
    if (done !== total) throw new Error(`the server sent ${done} of ${total} bytes of ${what}: try again`);
  } catch (thrown) {
    throw toCallError(thrown);
  }
  return new Blob(parts);
}
