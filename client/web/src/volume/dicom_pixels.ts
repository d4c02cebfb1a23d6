// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import dicomParser from "dicom-parser";
import { CODECS } from "./dicom_codecs";
import { nameOf, type DicomHeader } from "./dicom_header";
import { ON_COMMAND_LINE } from "./slice_stack";

const PIXELS = "x7fe00010";
const BIG_ENDIAN = "1.2.840.10008.1.2.2";
const NATIVE = ["1.2.840.10008.1.2", "1.2.840.10008.1.2.1", BIG_ENDIAN];
/** JPEG with loss: rare in CT. */
const LOSSY_JPEG = ["1.2.840.10008.1.2.4.50", "1.2.840.10008.1.2.4.51"];

type Samples = Uint8Array | Uint16Array | Uint32Array | Int8Array | Int16Array | Int32Array;

/** Why pixels of this transfer syntax are not read; empty: they are. */
export function syntaxObjection(transferSyntax: string): string {
  if (NATIVE.includes(transferSyntax) || CODECS.has(transferSyntax)) return "";
  const name = /^[0-9.]{1,64}$/.test(transferSyntax) ? transferSyntax : "unknown";
  if (LOSSY_JPEG.includes(name)) return `its images are JPEG with loss (${name}), which the page does not decode: use ${ON_COMMAND_LINE}`;
  return `its images are compressed in a way that is not read (transfer syntax ${name}): export them uncompressed`;
}

/** Its pixels take time to decode. */
export function isCompressed({ transferSyntax }: DicomHeader): boolean {
  return !NATIVE.includes(transferSyntax);
}

function cannotDecode(header: DicomHeader, why: string): Error {
  return new Error(`${nameOf(header)} cannot be read: ${why}; export the series again`);
}

function parsed(header: DicomHeader, bytes: Uint8Array): dicomParser.DataSet {
  try {
    return dicomParser.parseDicom(bytes);
  } catch {
    throw cannotDecode(header, "it is truncated or damaged");
  }
}

/** Whether the compressed pixels end as PS3.5, A.4 says: decoders pass over what is missing. */
function endsInDelimiter(bytes: Uint8Array): boolean {
  const end = [0xfe, 0xff, 0xdd, 0xe0, 0, 0, 0, 0];
  for (let at = bytes.length - end.length; at >= 0; --at) {
    if (end.every((byte, i) => bytes[at + i] === byte)) return true;
  }
  return false;
}

/** Compressed pixels of one image: of frames each has a fragment of its own, or the table of offsets says where it begins. */
function streamOf(header: DicomHeader, data: dicomParser.DataSet, element: dicomParser.Element): Uint8Array<ArrayBuffer> {
  const { fragments = [], basicOffsetTable = [] } = element;
  if (header.frames === 1) return dicomParser.readEncapsulatedPixelDataFromFragments(data, element, 0, fragments.length) as Uint8Array<ArrayBuffer>;
  if (fragments.length === header.frames) return dicomParser.readEncapsulatedPixelDataFromFragments(data, element, header.frame, 1) as Uint8Array<ArrayBuffer>;
  if (basicOffsetTable.length === header.frames) return dicomParser.readEncapsulatedImageFrame(data, element, header.frame) as Uint8Array<ArrayBuffer>;
  throw new Error("its fragments do not tell its frames apart");
}

async function decoded(header: DicomHeader, data: dicomParser.DataSet, element: dicomParser.Element, samples: number, bytesPerSample: number): Promise<Uint8Array> {
  const codec = CODECS.get(header.transferSyntax);
  if (codec === undefined) throw cannotDecode(header, syntaxObjection(header.transferSyntax));
  try {
    return await codec(streamOf(header, data, element), samples, bytesPerSample);
  } catch {
    throw cannotDecode(header, "its pixels are truncated or damaged");
  }
}

function swapped(bytes: Uint8Array, bytesPerSample: number): Uint8Array {
  const out = bytes.slice();
  for (let at = 0; at < out.length; at += bytesPerSample) out.subarray(at, at + bytesPerSample).reverse();
  return out;
}

function samplesOf(bytes: Uint8Array, bytesPerSample: number, isSigned: boolean): Samples {
  const { buffer, byteLength } = bytes.byteOffset % bytesPerSample === 0 ? bytes : bytes.slice();
  const offset = byteLength === buffer.byteLength ? 0 : bytes.byteOffset;
  const count = byteLength / bytesPerSample;
  if (bytesPerSample === 1) return isSigned ? new Int8Array(buffer, offset, count) : new Uint8Array(buffer, offset, count);
  if (bytesPerSample === 2) return isSigned ? new Int16Array(buffer, offset, count) : new Uint16Array(buffer, offset, count);
  return isSigned ? new Int32Array(buffer, offset, count) : new Uint32Array(buffer, offset, count);
}

/** Bits over BitsStored may hold anything, and decoders lose the sign of values with fewer bits: both are taken from the stored bits alone. */
function keepStoredBits(samples: Samples, bitsStored: number, isSigned: boolean): void {
  const unused = 32 - bitsStored;
  if (bitsStored < 1 || bitsStored >= 8 * samples.BYTES_PER_ELEMENT) return;
  for (let i = 0; i < samples.length; ++i) samples[i] = isSigned ? (samples[i] << unused) >> unused : (samples[i] << unused) >>> unused;
}

/** Whole Hounsfield units as the server rounds them: halves away from zero. */
export function toStored(value: number): number {
  const held = Math.min(Math.max(value, -32768), 32767);
  return held < 0 ? -Math.round(-held) : Math.round(held);
}

/** The images of one file. */
export interface FilePixels {
  /** Writes the pixels of one of them as Hounsfield units. `out`: rows x columns. Rejects with one line that names the file. */
  read(slice: DicomHeader, out: Int16Array): Promise<void>;
}

/** Reads the file of a slice. Rejects with one line that names it. */
export async function openPixels(header: DicomHeader): Promise<FilePixels> {
  const bytes = new Uint8Array(await header.file.arrayBuffer());
  const data = parsed(header, bytes);
  const element = data.elements[PIXELS];
  if (!element) throw cannotDecode(header, "it has no pixels");
  const bitsAllocated = data.uint16("x00280100") ?? 0;
  if (![8, 16, 32].includes(bitsAllocated)) throw cannotDecode(header, "its pixels have an unsupported type");
  const bytesPerSample = bitsAllocated / 8;
  const isNative = !isCompressed(header);
  if (!isNative && (!element.fragments || element.fragments.length === 0 || !endsInDelimiter(bytes))) throw cannotDecode(header, "it is truncated");
  const isSigned = data.uint16("x00280103") === 1;
  const bitsStored = data.uint16("x00280101") ?? 0;
  const rawOf = async (slice: DicomHeader, count: number) => {
    if (!isNative) return decoded(slice, data, element, count, bytesPerSample);
    const begin = element.dataOffset + slice.frame * count * bytesPerSample;
    const raw = bytes.subarray(begin, begin + count * bytesPerSample);
    if (raw.length < count * bytesPerSample) throw cannotDecode(slice, "it is truncated");
    return raw;
  };
  return {
    async read(slice, out) {
      const raw = await rawOf(slice, out.length);
      const isOfFrames = !isNative || slice.frames === 1 || element.length >= slice.frames * raw.length;
      if (raw.length !== out.length * bytesPerSample || !isOfFrames) throw cannotDecode(slice, "its number of pixels does not match rows and columns");
      const samples = samplesOf(slice.transferSyntax === BIG_ENDIAN ? swapped(raw, bytesPerSample) : raw, bytesPerSample, isSigned);
      keepStoredBits(samples, bitsStored, isSigned);
      const [slope, intercept] = [slice.slope ?? 1, slice.intercept ?? 0];
      for (let i = 0; i < out.length; ++i) out[i] = toStored(slope * samples[i] + intercept);
    },
  };
}
