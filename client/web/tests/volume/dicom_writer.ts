// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

// DICOM files made by hand: explicit VR, little endian, with an identifier in every place that may hold one.

export const SECRET = "Musterfrau";
const LONG_LENGTH = ["OB", "OW", "SQ", "UN", "UT"];

export interface SliceOptions {
  readonly rows?: number;
  readonly columns?: number;
  readonly values?: Int16Array;
  readonly position?: readonly number[];
  /** Text elements by tag "00100010", that replace or add; null leaves one out. */
  readonly texts?: Readonly<Record<string, readonly [vr: string, value: string] | null>>;
  readonly bitsStored?: number;
  readonly isSigned?: boolean;
  readonly mediaClass?: string;
}

function element(tag: string, vr: string, value: Uint8Array): Uint8Array {
  const isLong = LONG_LENGTH.includes(vr);
  const padded = value.length + (value.length % 2);
  const bytes = new Uint8Array((isLong ? 12 : 8) + padded);
  const view = new DataView(bytes.buffer);
  view.setUint16(0, parseInt(tag.slice(0, 4), 16), true);
  view.setUint16(2, parseInt(tag.slice(4), 16), true);
  bytes.set([vr.charCodeAt(0), vr.charCodeAt(1)], 4);
  if (isLong) view.setUint32(8, padded, true);
  else view.setUint16(6, padded, true);
  bytes.set(value, isLong ? 12 : 8);
  if (value.length % 2 !== 0) bytes[bytes.length - 1] = vr === "UI" ? 0 : 0x20;
  return bytes;
}

const text = (value: string) => new TextEncoder().encode(value);
const short = (value: number) => new Uint8Array(new Uint16Array([value]).buffer);

function joined(parts: readonly Uint8Array[]): Uint8Array<ArrayBuffer> {
  const bytes = new Uint8Array(parts.reduce((sum, part) => sum + part.length, 0));
  let at = 0;
  for (const part of parts) {
    bytes.set(part, at);
    at += part.length;
  }
  return bytes;
}

const IDENTIFIERS: Readonly<Record<string, readonly [string, string]>> = {
  "00080020": ["DA", "19990102"], "00080030": ["TM", "010203"], "00080050": ["SH", `${SECRET}-a`], "00080080": ["LO", `${SECRET}-clinic`], "00080090": ["PN", `${SECRET}^Doctor`],
  "00081010": ["SH", `${SECRET}-ct1`], "00081030": ["LO", `${SECRET}-study`], "00081070": ["PN", `${SECRET}^Operator`], "00090010": ["LO", `${SECRET}-maker`], "00091001": ["LO", `${SECRET}-private`],
  "00100010": ["PN", `${SECRET}^Erika`], "00100020": ["LO", `${SECRET}-id`], "00100030": ["DA", "19640812"], "00101040": ["LO", `${SECRET}-street`], "00104000": ["LT", `${SECRET}-comment`],
  "00181000": ["LO", `${SECRET}-serial`], "00200010": ["SH", `${SECRET}-s`],
};

/** Values that distinguish every voxel of a series. */
export function patternOf(rows: number, columns: number, k: number): Int16Array {
  return Int16Array.from({ length: rows * columns }, (_, i) => ((i * 7 + k * 131) % 4000) - 1000);
}

/** The bytes of one slice. `k` places it, 2 mm from the one before, and numbers it. */
export function dicomSlice(k: number, options: SliceOptions = {}): Uint8Array<ArrayBuffer> {
  const { rows = 6, columns = 5, isSigned = true, bitsStored = 16, mediaClass = "1.2.840.10008.5.1.4.1.1.2" } = options;
  const values = options.values ?? patternOf(rows, columns, k);
  const texts: Record<string, readonly [string, string] | null> = {
    ...IDENTIFIERS,
    "00080008": ["CS", "ORIGINAL\\PRIMARY\\AXIAL"], "00080016": ["UI", "1.2.840.10008.5.1.4.1.1.2"], "00080018": ["UI", `1.2.3.77.${k + 1}`], "00080060": ["CS", "CT"], "0008103e": ["LO", "Head 1.0"],
    "00180050": ["DS", "2"], "00181210": ["SH", "H30s"], "0020000d": ["UI", "1.2.3.77"], "0020000e": ["UI", "1.2.3.77.1"], "00200011": ["IS", "2"], "00200013": ["IS", `${k + 1}`],
    "00200032": ["DS", (options.position ?? [-10, -20, 2 * k]).join("\\")], "00200037": ["DS", "1\\0\\0\\0\\1\\0"], "00200052": ["UI", "1.2.3.77.9"],
    "00280004": ["CS", "MONOCHROME2"], "00280030": ["DS", "0.5\\0.25"], "00281052": ["DS", "0"], "00281053": ["DS", "1"], ...options.texts,
  };
  const shorts: Record<string, number> = { "00280002": 1, "00280010": rows, "00280011": columns, "00280100": 16, "00280101": bitsStored, "00280102": bitsStored - 1, "00280103": isSigned ? 1 : 0 };
  const elements = [...Object.entries(texts).flatMap(([tag, value]) => (value === null ? [] : [{ tag, vr: value[0], value: text(value[1]) }])),
    ...Object.entries(shorts).map(([tag, value]) => ({ tag, vr: "US", value: short(value) }))].sort((a, b) => (a.tag < b.tag ? -1 : 1));
  const meta = [element("00020002", "UI", text(mediaClass)), element("00020003", "UI", text(`1.2.3.77.${k + 1}`)), element("00020010", "UI", text("1.2.840.10008.1.2.1"))];
  const metaBytes = joined(meta);
  const length = element("00020000", "UL", new Uint8Array(new Uint32Array([metaBytes.length]).buffer));
  const pixels = element("7fe00010", "OW", new Uint8Array(values.buffer, values.byteOffset, values.byteLength));
  return joined([new Uint8Array(128), text("DICM"), length, metaBytes, ...elements.map(({ tag, vr, value }) => element(tag, vr, value)), pixels]);
}

export interface NamedFile {
  readonly path: string;
  readonly file: Blob;
}

export function named(path: string, bytes: Uint8Array<ArrayBuffer> | string): NamedFile {
  return { path, file: new Blob([bytes]) };
}

/** A folder of `count` slices whose names are not in their order. */
export function dicomFolder(count: number, options: (k: number) => SliceOptions = () => ({}), folder = `${SECRET}/scan`): NamedFile[] {
  return Array.from({ length: count }, (_, k) => named(`${folder}/IM${String(count - k).padStart(4, "0")}`, dicomSlice(k, options(k))));
}
