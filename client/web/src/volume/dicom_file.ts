// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import dicomParser from "dicom-parser";
import { framesOf } from "./dicom_frames";
import { type DicomHeader, headerOf, unreadable } from "./dicom_header";
import { Tags } from "./dicom_tags";

const DEFLATED = "1.2.840.10008.1.2.1.99";
/** Headers are shorter, nearly always: the pixels of a file that is only listed are not read. */
const HEADER_BYTES = 64 * 1024;
const PREAMBLE_BYTES = 132;
const PIXELS = "x7fe00010";

function isDicom(bytes: Uint8Array): boolean {
  return bytes.length >= PREAMBLE_BYTES && String.fromCharCode(...bytes.subarray(PREAMBLE_BYTES - 4, PREAMBLE_BYTES)) === "DICM";
}

/** The header up to the pixels; null where the bytes end before. */
function parseHeader(bytes: Uint8Array, isWhole: boolean): dicomParser.DataSet | null {
  try {
    const data = dicomParser.parseDicom(bytes, { untilTag: PIXELS });
    return isWhole || data.elements[PIXELS] ? data : null;
  } catch {
    return null;
  }
}

/** Reads the header of a file, or those of the frames of a multi-frame file; none when it is not a DICOM file. */
export async function readDicomHeaders(file: Blob, fileNumber: number): Promise<DicomHeader[]> {
  const start = new Uint8Array(await file.slice(0, HEADER_BYTES).arrayBuffer());
  if (!isDicom(start)) return [];
  let meta;
  try {
    meta = dicomParser.readPart10Header(start);
  } catch {
    return [unreadable(file, fileNumber, "damaged")];
  }
  const transferSyntax = (meta.string("x00020010") ?? "").trim();
  if (transferSyntax === DEFLATED) return [unreadable(file, fileNumber, "deflated")];
  const isWhole = file.size <= HEADER_BYTES;
  const data = parseHeader(start, isWhole) ?? (isWhole ? null : parseHeader(new Uint8Array(await file.arrayBuffer()), true));
  if (data === null) return [unreadable(file, fileNumber, "damaged")];
  const tags = new Tags(data);
  const header = headerOf(file, fileNumber, tags, (meta.string("x00020002") ?? "").trim(), transferSyntax);
  const frames = header.kind === "multi-frame" ? framesOf(tags, header) : [];
  return frames.length === 0 ? [header] : frames;
}
