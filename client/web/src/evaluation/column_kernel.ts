// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

/** Rows and columns are padded to multiples of these, so that products have no rest. */
const ROW_BLOCK = 16;
const COLUMN_BLOCK = 4;

export function paddedRows(rows: number): number {
  return Math.ceil(rows / ROW_BLOCK) * ROW_BLOCK;
}

export function paddedColumns(columns: number): number {
  return Math.ceil(columns / COLUMN_BLOCK) * COLUMN_BLOCK;
}

/** Who multiplies columns. Arrays that it is given come from its own `floats`. */
export interface ColumnKernel {
  readonly name: "javascript" | "webassembly";
  /** So many numbers, all 0. */
  floats(count: number): Float32Array;
  /**
   * sums = columns * factors. `columns`: `rows` by `count`, column-major, both padded. `factors` is `width` (1 or 3) planes of
   * `count`, `sums` as many of `rows`.
   */
  multiply(columns: Float32Array, rows: number, count: number, factors: Float32Array, width: number, sums: Float32Array): void;
}

/** In plain JavaScript: four columns at a time, so that sums are seldom read and written. */
export const javascriptKernel: ColumnKernel = {
  name: "javascript",
  floats: (count) => new Float32Array(count),
  multiply: (columns, rows, count, factors, width, sums) => {
    sums.fill(0);
    for (let c = 0; c < count; c += COLUMN_BLOCK) {
      if (width === 3) addToThree(columns, rows, count, c, factors, sums);
      else addToOne(columns, rows, c, factors, sums);
    }
  },
};

function addToOne(columns: Float32Array, rows: number, c: number, factors: Float32Array, sums: Float32Array): void {
  const first = c * rows, second = first + rows, third = second + rows, fourth = third + rows;
  const a = factors[c], b = factors[c + 1], d = factors[c + 2], e = factors[c + 3];
  for (let r = 0; r < rows; ++r) {
    sums[r] += a * columns[first + r] + b * columns[second + r] + (d * columns[third + r] + e * columns[fourth + r]);
  }
}

function addToThree(columns: Float32Array, rows: number, count: number, c: number, factors: Float32Array, sums: Float32Array): void {
  const first = c * rows, second = first + rows, third = second + rows, fourth = third + rows;
  const y = count, z = 2 * count;
  const ax = factors[c], bx = factors[c + 1], dx = factors[c + 2], ex = factors[c + 3];
  const ay = factors[y + c], by = factors[y + c + 1], dy = factors[y + c + 2], ey = factors[y + c + 3];
  const az = factors[z + c], bz = factors[z + c + 1], dz = factors[z + c + 2], ez = factors[z + c + 3];
  const planeY = rows, planeZ = 2 * rows;
  for (let r = 0; r < rows; ++r) {
    const p = columns[first + r], q = columns[second + r], s = columns[third + r], t = columns[fourth + r];
    sums[r] += ax * p + bx * q + (dx * s + ex * t);
    sums[planeY + r] += ay * p + by * q + (dy * s + ey * t);
    sums[planeZ + r] += az * p + bz * q + (dz * s + ez * t);
  }
}
