// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

// The bytes of docs/prepared-answers.md, laid out as typed arrays. What reads them is checkAnswers' business as well: sizes and
// indices are judged there before anything is evaluated.

import { checkAnswers } from "./answer_checks";
import type { AnswerNumbers, PackedColumns, PreparedColumns } from "./prepared_columns";

export const MOST_ANSWER_BYTES = 2 ** 28;

/** The newest version that is read. */
const NEWEST_VERSION = 2;
const MAGIC = "TFANSWER";
const ALIGNMENT = 16;
const HEAD_BYTES = 16;
const ENTRY_BYTES = 16;
const MOST_SECTIONS = 1000;

/** Why bytes are no prepared answers that may be used, in one line. */
export class AnswersError extends Error {
  override readonly name = "AnswersError";
}

const NUMBER_NAMES: readonly (keyof AnswerNumbers)[] = [
  "model", "vertices", "handles", "toleranceMm", "maxRotation", "maxScaleChange", "maxEstimateMm", "largestRestMm",
  "polynomials", "degree", "simplexWidth", "largestGainMm", "sizeMm", "estimateScale", "cutPerMm", "roundingMm",
];

interface Entry {
  type: number;
  offset: number;
  count: number;
}

const TYPES = { 1: Float64Array, 2: Float32Array, 3: Int32Array, 4: Int16Array } as const;
type TypeNumber = keyof typeof TYPES;

/** Throws an AnswersError for bytes that are cut off, damaged or too large; what returns may be evaluated. */
export function readAnswers(bytes: Uint8Array, mostBytes = MOST_ANSWER_BYTES): PreparedColumns {
  if (bytes.length > mostBytes) throw new AnswersError(`prepared answers of ${bytes.length} bytes; at most ${mostBytes} are read`);
  const aligned = bytes.byteOffset % ALIGNMENT === 0 ? bytes : bytes.slice();
  const sections = readTable(aligned);
  const take = <T extends TypeNumber>(number: number, type: T) => section(aligned, sections.get(number), type) as InstanceType<(typeof TYPES)[T]>;
  const packed = (first: number): PackedColumns => ({ steps: take(first, 1), upper: take(first + 1, 4), lower: take(first + 2, 4) });
  const answers: PreparedColumns = {
    version: sections.version,
    numbers: namedNumbers(take(1, 1)),
    regions: take(2, 3),
    freeRest: take(3, 2),
    fixedRest: take(4, 2),
    handleRest: take(5, 1),
    origins: take(10, 1),
    centroids: take(11, 1),
    nodes: take(12, 1),
    interpolation: take(13, 1),
    simplexLow: take(14, 1),
    guardGains: take(15, 1),
    map: take(20, 1),
    gains: take(21, 1),
    cutMap: take(22, 2),
    tail: take(23, 2),
    columns: packed(24),
    clusterMap: packed(30),
    clusters: take(33, 3),
    clusterVertices: take(34, 3),
    firstGains: take(40, 1),
    secondGains: take(41, 1),
    probes: take(42, 2),
    secondLengths: take(43, 2),
    thirdLengths: take(44, 2),
    thirdGains: take(45, 1),
    bandMap: take(60, 1),
    band: { steps: take(61, 1), upper: take(62, 4), lower: new Int16Array() },
  };
  const wrong = checkAnswers(answers);
  if (wrong !== "") throw new AnswersError(wrong);
  return answers;
}

class Table extends Map<number, Entry> {
  version = 0;
}

/** Sections by their numbers; every one behind the one before it, the last one at the end. */
function readTable(bytes: Uint8Array): Table {
  if (bytes.length < HEAD_BYTES || String.fromCharCode(...bytes.subarray(0, 8)) !== MAGIC) {
    throw new AnswersError("these are not prepared answers");
  }
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const table = new Table();
  table.version = view.getUint32(8, true);
  if (table.version < 1 || table.version > NEWEST_VERSION) {
    throw new AnswersError(`prepared answers of version ${table.version}; this reader knows 1 to ${NEWEST_VERSION}`);
  }
  const count = view.getUint32(12, true);
  let end = HEAD_BYTES + count * ENTRY_BYTES;
  let isWhole = count <= MOST_SECTIONS && end <= bytes.length;
  for (let i = 0; isWhole && i < count; ++i) {
    const [number, type, offset, values] = [0, 4, 8, 12].map((at) => view.getUint32(HEAD_BYTES + i * ENTRY_BYTES + at, true));
    const size = values * (TYPES[type as TypeNumber]?.BYTES_PER_ELEMENT ?? NaN);
    isWhole = offset % ALIGNMENT === 0 && offset >= end && offset + size <= bytes.length && !table.has(number);
    table.set(number, { type, offset, count: values });
    end = offset + size;
  }
  if (!isWhole || Math.ceil(end / ALIGNMENT) * ALIGNMENT !== bytes.length) {
    throw new AnswersError("prepared answers are incomplete or damaged; fetch them again");
  }
  return table;
}

function section(bytes: Uint8Array, entry: Entry | undefined, type: TypeNumber) {
  if (entry === undefined) return new TYPES[type](0);
  if (entry.type !== type) throw new AnswersError("a section has another type or length than it should");
  return new TYPES[type](bytes.buffer as ArrayBuffer, bytes.byteOffset + entry.offset, entry.count);
}

function namedNumbers(values: Float64Array): AnswerNumbers {
  if (values.length !== NUMBER_NAMES.length) throw new AnswersError("a section has another type or length than it should");
  return Object.fromEntries(NUMBER_NAMES.map((name, i) => [name, values[i]])) as unknown as AnswerNumbers;
}
