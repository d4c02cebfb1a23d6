// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { toStored } from "./dicom_pixels";
import { readMetaImageHeader } from "./metaimage_header";
import { readNiftiHeader } from "./nifti_header";
import { readNrrdHeader } from "./nrrd_header";
import type { DroppedFile, OpenedCt, SeriesEntry } from "./opened_ct";
import { checkSize, LEAST_SLICES } from "./slice_stack";
import type { LabelMap, Volume } from "./volume";
import { unpackedBytes, type ValueType, type VolumeHeader } from "./volume_header";

const LEAST_SPACING_MM = 0.05;
const MAX_SPACING_MM = 10;
const MAX_LABEL = 65535;
const BYTES: Readonly<Record<ValueType, number>> = { int8: 1, uint8: 1, int16: 2, uint16: 2, int32: 4, uint32: 4, int64: 8, uint64: 8, float32: 4, float64: 8 };
const READERS: readonly (readonly [RegExp, (file: Blob) => Promise<VolumeHeader>])[] = [
  [/\.nrrd$/i, readNrrdHeader],
  [/\.nii(\.gz)?$/i, readNiftiHeader],
  [/\.mha$/i, readMetaImageHeader],
];

export function isVolumeFile(path: string): boolean {
  return READERS.some(([ending]) => ending.test(path));
}

async function readHeader({ path, file }: DroppedFile): Promise<VolumeHeader> {
  const reader = READERS.find(([ending]) => ending.test(path));
  if (reader === undefined) throw new Error("the file's ending is not .nrrd, .nii, .nii.gz or .mha; choose such a file");
  const header = await reader[1](file);
  checkSize(header.grid.size);
  const { origin, directions, spacing } = header.grid;
  if (![...origin, ...directions.flat()].every(Number.isFinite)) throw new Error("the file places its voxels at no finite position; export it again");
  const wrong = spacing.findIndex((mm) => !(mm >= LEAST_SPACING_MM && mm <= MAX_SPACING_MM));
  if (wrong >= 0) throw new Error(`the voxels are ${spacing[wrong]} mm apart along axis ${wrong + 1}; between ${LEAST_SPACING_MM} and ${MAX_SPACING_MM} mm are read`);
  return header;
}

function numberAt(view: DataView, type: ValueType, littleEndian: boolean): (index: number) => number {
  switch (type) {
    case "int8": return (i) => view.getInt8(i);
    case "uint8": return (i) => view.getUint8(i);
    case "int16": return (i) => view.getInt16(2 * i, littleEndian);
    case "uint16": return (i) => view.getUint16(2 * i, littleEndian);
    case "int32": return (i) => view.getInt32(4 * i, littleEndian);
    case "uint32": return (i) => view.getUint32(4 * i, littleEndian);
    case "int64": return (i) => Number(view.getBigInt64(8 * i, littleEndian));
    case "uint64": return (i) => Number(view.getBigUint64(8 * i, littleEndian));
    case "float32": return (i) => view.getFloat32(4 * i, littleEndian);
    case "float64": return (i) => view.getFloat64(8 * i, littleEndian);
  }
}

/** Calls `take` with each value. */
async function forEachValue(file: Blob, header: VolumeHeader, take: (value: number, index: number) => void): Promise<void> {
  const voxels = header.grid.size[0] * header.grid.size[1] * header.grid.size[2];
  const bytes = await unpackedBytes(file.slice(header.dataOffset), header.packing, header.skip + voxels * BYTES[header.type]);
  const at = numberAt(new DataView(bytes.buffer, header.skip), header.type, header.littleEndian);
  // ITK keeps such a product as float32, and the server reads through ITK.
  const isScaled = header.slope !== 1 || header.intercept !== 0;
  for (let i = 0; i < voxels; ++i) take(isScaled ? Math.fround(header.slope * at(i) + header.intercept) : at(i), i);
}

async function readVolume(file: Blob, header: VolumeHeader): Promise<Volume> {
  const { size } = header.grid;
  const values = new Int16Array(size[0] * size[1] * size[2]);
  await forEachValue(file, header, (value, i) => {
    if (!Number.isFinite(value)) throw new Error(`voxel ${i} is not a number; replace such voxels by air`);
    values[i] = toStored(value);
  });
  return { grid: header.grid, values, kernel: "" };
}

/** One volume in a file is a series that names nothing. */
export async function openVolumeFile(dropped: DroppedFile): Promise<OpenedCt> {
  const header = await readHeader(dropped);
  const { size, spacing } = header.grid;
  const short = size.findIndex((count) => count < LEAST_SLICES);
  const objections = short < 0 ? [] : [`the file has ${size[short]} voxels along its axis ${short + 1}; a volume needs at least ${LEAST_SLICES}`];
  const entry: SeriesEntry = {
    id: "1", modality: "", kernel: "", slices: size[2], size: [size[0], size[1]], sliceSpacing: spacing[2], pixelSpacing: spacing[0],
    millimeters: [size[0] * spacing[0], size[1] * spacing[1], size[2] * spacing[2]], description: "", objections,
  };
  return {
    series: [entry], proposed: objections.length === 0 ? entry.id : null, notes: [],
    async read(id, onProgress, signal) {
      if (id !== entry.id) throw new Error("there is no such series; choose one of the list");
      if (objections.length > 0) throw new Error(objections[0]);
      const volume = await readVolume(dropped.file, header);
      signal?.throwIfAborted();
      onProgress(1);
      return volume;
    },
    close() {},
  };
}

/** openLabels without a worker. */
export async function readLabels(dropped: DroppedFile): Promise<LabelMap> {
  const header = await readHeader(dropped);
  const { size } = header.grid;
  const values = new Uint16Array(size[0] * size[1] * size[2]);
  let most = 0;
  await forEachValue(dropped.file, header, (value, i) => {
    if (!(value >= 0 && value <= MAX_LABEL && Number.isInteger(value))) {
      throw new Error(`the file has the value ${value}, and labels are whole numbers from 0 to ${MAX_LABEL}: it is an image or a map of probabilities; export the label map`);
    }
    values[i] = value;
    most = Math.max(most, value);
  });
  if (most === 0) throw new Error("no voxel of the file is labelled; export the segmentation again");
  return { grid: header.grid, values: most < 256 ? Uint8Array.from(values) : values, names: header.names };
}
