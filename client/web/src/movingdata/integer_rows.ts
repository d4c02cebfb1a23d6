// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

// Rows of three whole numbers as bytes that compress well: of each column the differences from row to row, their sign in the lowest
// bit, all lowest bytes first, then all second ones, and so on (docs/moving-file.md).

const BYTES = 4;

/** `rows`: #rows by 3; each number and each difference below 2^31. */
export function packRows(rows: Int32Array): Uint8Array<ArrayBuffer> {
  const count = rows.length / 3;
  const out = new Uint8Array(BYTES * rows.length);
  for (let k = 0; k < 3; ++k) {
    let before = 0;
    for (let i = 0; i < count; ++i) {
      const difference = (rows[3 * i + k] - before) | 0;
      before = rows[3 * i + k];
      const folded = (difference << 1) ^ (difference >> 31);
      for (let b = 0; b < BYTES; ++b) out[b * rows.length + k * count + i] = folded >>> (8 * b);
    }
  }
  return out;
}

/** The inverse; null where that is not `count` rows. */
export function unpackRows(bytes: Uint8Array, count: number): Int32Array<ArrayBuffer> | null {
  const length = 3 * count;
  if (bytes.length !== BYTES * length) return null;
  const rows = new Int32Array(length);
  for (let k = 0; k < 3; ++k) {
    let value = 0;
    for (let i = 0; i < count; ++i) {
      const at = k * count + i;
      const folded = bytes[at] | (bytes[at + length] << 8) | (bytes[at + 2 * length] << 16) | (bytes[at + 3 * length] << 24);
      value = (value + ((folded >>> 1) ^ -(folded & 1))) | 0;
      rows[3 * i + k] = value;
    }
  }
  return rows;
}
