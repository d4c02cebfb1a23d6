// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { DicomHeader } from "./dicom_header";
import { type FilePixels, isCompressed, openPixels } from "./dicom_pixels";
import type { FromVolumeWorker, ToVolumeWorker } from "./opened_ct";

/** More workers than this wait for memory, not for the processor. */
const MOST_WORKERS = 8;
/** Of the files that they hold: each has the file that it reads in memory. */
const MOST_HELD_BYTES = 256 * 2 ** 20;
/** What a reader is given at a time: enough that messages do not count, and few enough to be held twice. */
const SLICES_AT_ONCE = 8;

/** Reads some slices, as Hounsfield units. Rejects with one line that names the file. */
export interface PixelReader {
  read(slices: readonly DicomHeader[]): Promise<readonly Int16Array[]>;
  close(): void;
}

/** Here and now. A file of many frames is kept for the next of them. */
export class LocalReader implements PixelReader {
  private held: { fileNumber: number; pixels: FilePixels } | null = null;

  async read(slices: readonly DicomHeader[]): Promise<Int16Array<ArrayBuffer>[]> {
    const images: Int16Array<ArrayBuffer>[] = [];
    for (const slice of slices) {
      if (this.held?.fileNumber !== slice.fileNumber) this.held = { fileNumber: slice.fileNumber, pixels: await openPixels(slice) };
      const image = new Int16Array(slice.rows * slice.columns);
      await this.held.pixels.read(slice, image);
      images.push(image);
    }
    return images;
  }

  close(): void {}
}

/** A copy of the worker that this runs in. */
class WorkerReader implements PixelReader {
  private readonly worker = new Worker(globalThis.location.href);

  read(slices: readonly DicomHeader[]): Promise<readonly Int16Array[]> {
    return new Promise((resolve, reject) => {
      const stopped = new Error("the reader of the CT stopped; reload the page and try again");
      this.worker.onerror = () => reject(stopped);
      this.worker.onmessage = ({ data }: MessageEvent<FromVolumeWorker>) => {
        if ("images" in data) resolve(data.images);
        else reject("error" in data ? new Error(data.error) : stopped);
      };
      this.worker.postMessage({ call: "pixels", slices, number: 0 } satisfies ToVolumeWorker);
    });
  }

  close(): void {
    this.worker.terminate();
  }
}

/** One for each processor where there is something to decode, otherwise one: bytes as they are come as fast as the disk gives them. */
export function pixelReaders(slices: readonly DicomHeader[]): PixelReader[] {
  if (typeof Worker === "undefined" || !slices.some(isCompressed)) return [new LocalReader()];
  const largest = slices.reduce((most, { file }) => Math.max(most, file.size), 1);
  const count = Math.min(navigator.hardwareConcurrency, MOST_WORKERS, Math.floor(MOST_HELD_BYTES / largest));
  return count < 2 ? [new LocalReader()] : Array.from({ length: count }, () => new WorkerReader());
}

/** In parts of some slices each, those of one file one after the other. */
export function partsOf(slices: readonly DicomHeader[]): DicomHeader[][] {
  const ordered = [...slices].sort((a, b) => a.fileNumber - b.fileNumber);
  return Array.from({ length: Math.ceil(ordered.length / SLICES_AT_ONCE) }, (_, part) => ordered.slice(part * SLICES_AT_ONCE, (part + 1) * SLICES_AT_ONCE));
}
