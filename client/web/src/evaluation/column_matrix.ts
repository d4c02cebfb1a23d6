// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type AnswerSizes, sizesOf } from "./answer_sizes";
import { type ColumnKernel, paddedColumns, paddedRows } from "./column_kernel";
import { AnswerModel, type PackedColumns, type PreparedColumns } from "./prepared_columns";

const UPPER = 65536;
/** For the alignment of a part's arrays. */
const SLACK = 64;

/** A part of packed columns, from these places on. */
export interface PackedPart {
  packed: PackedColumns;
  rows: number;
  columns: number;
  /** The last ones, with lower halves. */
  full: number;
  firstColumn: number;
  firstUpper: number;
  firstLower: number;
}

export function wholeOf(packed: PackedColumns, rows: number): PackedPart {
  const full = rows > 0 ? packed.lower.length / rows : 0;
  return { packed, rows, columns: packed.steps.length, full, firstColumn: 0, firstUpper: 0, firstLower: 0 };
}

/** Parts whose rows are the free vertices': all columns, or of neo_hookean those of each cluster in turn. */
export function partsOf({ numbers, clusters, columns: packed }: PreparedColumns, rows: number): PackedPart[] {
  if (numbers.model !== AnswerModel.NEO_HOOKEAN) return [wholeOf(packed, rows)];
  const parts: PackedPart[] = [];
  let [firstColumn, firstUpper, firstLower] = [0, 0, 0];
  for (let k = 0; k < clusters.length; k += 3) {
    const [vertices, columns, full] = clusters.subarray(k, k + 3);
    parts.push({ packed, rows: 3 * vertices, columns, full, firstColumn, firstUpper, firstLower });
    firstColumn += columns;
    firstUpper += 3 * vertices * columns;
    firstLower += 3 * vertices * full;
  }
  return parts;
}

/** That of the band: rows of all variables one after the other. */
export function bandPartOf(answers: PreparedColumns, { free, bandVariables }: AnswerSizes): PackedPart {
  return wholeOf(answers.band, 3 * free * bandVariables);
}

/** How many numbers a kernel needs for the columns of these answers, with what they are multiplied by and what they give. */
export function floatsOf(answers: PreparedColumns): number {
  const sizes = sizesOf(answers);
  const parts = [...partsOf(answers, sizes.rows), bandPartOf(answers, sizes)];
  const ofPart = ({ rows, columns }: PackedPart) => (paddedRows(rows) + sizes.width) * paddedColumns(columns) + sizes.width * paddedRows(rows) + SLACK;
  return parts.reduce((sum, part) => sum + ofPart(part), 0);
}

/** Calls `take` with every entry's row, column and value. */
export function unpack(part: PackedPart, take: (row: number, column: number, value: number) => void): void {
  const { packed, rows, columns, full } = part;
  for (let c = 0; c < columns; ++c) {
    const step = packed.steps[part.firstColumn + c];
    const upper = part.firstUpper + c * rows;
    const lower = part.firstLower + (c - (columns - full)) * rows;
    const isFull = c >= columns - full;
    for (let r = 0; r < rows; ++r) {
      take(r, c, (UPPER * packed.upper[upper + r] + (isFull ? packed.lower[lower + r] : 0)) * step);
    }
  }
}

/** Columns laid out for a kernel, in single precision, and what they give. */
export class ColumnMatrix {
  /** Planes of the displacements: entry `row` of plane f is at `f * stride + row`. */
  readonly sums: Float32Array;
  readonly stride: number;

  private readonly columns: Float32Array;
  private readonly factors: Float32Array;
  private readonly count: number;
  private readonly paddedCount: number;

  constructor(
    private readonly kernel: ColumnKernel,
    part: PackedPart,
    private readonly width: number,
  ) {
    this.stride = paddedRows(part.rows);
    this.count = part.columns;
    this.paddedCount = paddedColumns(part.columns);
    const columns = kernel.floats(this.stride * this.paddedCount);
    unpack(part, (row, column, value) => (columns[column * this.stride + row] = value));
    this.columns = columns;
    this.factors = kernel.floats(width * this.paddedCount);
    this.sums = kernel.floats(width * this.stride);
  }

  /** `mapped`: rows of `width` numbers, those of this matrix from row `first` on. */
  multiply(mapped: Float64Array, first: number): void {
    const { factors, width, count, paddedCount } = this;
    for (let f = 0; f < width; ++f) {
      for (let c = 0; c < count; ++c) factors[f * paddedCount + c] = mapped[(first + c) * width + f];
    }
    this.kernel.multiply(this.columns, this.stride, paddedCount, factors, width, this.sums);
  }
}
