// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { DicomHeader } from "./dicom_header";
import type { LabelMap, Volume } from "./volume";

// A CT is read in the browser. Parsing and decoding run in a worker; what leaves it is the interface below and nothing else of the files.

/** `path`: as it lay in the folder; it never leaves the page. */
export interface DroppedFile {
  readonly path: string;
  readonly file: Blob;
}

export interface SeriesEntry {
  readonly id: string;
  readonly modality: string;
  readonly kernel: string;
  readonly slices: number;
  /** Columns, rows. */
  readonly size: readonly [number, number];
  readonly sliceSpacing: number;
  readonly pixelSpacing: number;
  readonly millimeters: readonly [number, number, number];
  /** As the scanner's protocol names it: shown only, never sent. */
  readonly description: string;
  /** Why it cannot be used; empty: it can. */
  readonly objections: readonly string[];
}

export interface OpenedCt {
  readonly series: readonly SeriesEntry[];
  /** The series that the server's command line would take; null where the user must choose. */
  readonly proposed: string | null;
  /** One sentence each: what was left out, and why. */
  readonly notes: readonly string[];
  read(id: string, onProgress: (share: number) => void, signal?: AbortSignal): Promise<Volume>;
  close(): void;
}

export interface OpenedLabels {
  read(): Promise<LabelMap>;
}

export type VolumeCall =
  | { readonly call: "open"; readonly files: readonly DroppedFile[] }
  | { readonly call: "read"; readonly id: string }
  | { readonly call: "labels"; readonly file: DroppedFile }
  | { readonly call: "pixels"; readonly slices: readonly DicomHeader[] }
  | { readonly call: "cancel" };

/** `number`: of the call that an answer belongs to; one that was cancelled may still answer. */
export type ToVolumeWorker = VolumeCall & { readonly number: number };

export type VolumeAnswer =
  | { readonly share: number }
  | { readonly opened: Pick<OpenedCt, "series" | "proposed" | "notes"> }
  | { readonly volume: Volume }
  | { readonly labels: LabelMap }
  | { readonly images: readonly Int16Array[] }
  | { readonly error: string };

export type FromVolumeWorker = VolumeAnswer & { readonly number: number };

/** One call after the other: a second one while the first runs is an error of the caller. */
class VolumeWorkerHost {
  private readonly worker = new Worker(new URL("./volume_worker.ts", import.meta.url));
  private calls = 0;
  private rejectPending: (reason: unknown) => void = () => {};

  close(): void {
    this.worker.terminate();
    this.rejectPending(new DOMException("the CT was closed", "AbortError"));
  }

  call<T>(message: VolumeCall, take: (answer: VolumeAnswer) => T | undefined, onProgress: (share: number) => void, signal?: AbortSignal): Promise<T> {
    return new Promise((resolve, reject) => {
      if (signal?.aborted) return reject(signal.reason);
      const number = ++this.calls;
      this.rejectPending = reject;
      const cancel = () => {
        this.worker.postMessage({ call: "cancel", number } satisfies ToVolumeWorker);
        reject(signal?.reason);
      };
      signal?.addEventListener("abort", cancel, { once: true });
      const end = (settle: () => void) => {
        signal?.removeEventListener("abort", cancel);
        settle();
      };
      this.worker.onerror = () => end(() => reject(new Error("the reader of the CT stopped; reload the page and try again")));
      this.worker.onmessage = ({ data }: MessageEvent<FromVolumeWorker>) => {
        if (data.number !== number) return;
        if ("share" in data) return onProgress(data.share);
        const answer = take(data);
        if (answer !== undefined) end(() => resolve(answer));
        else end(() => reject(new Error("error" in data ? data.error : "the reader of the CT gave another answer; reload the page")));
      };
      this.worker.postMessage({ ...message, number });
    });
  }
}

/** Opens a DICOM folder, a zip of one, or one .nrrd, .nii, .nii.gz or .mha, and lists its series. Rejects with one sentence: what, where, what to do. Close what is opened: it holds a worker. */
export async function openCt(files: readonly DroppedFile[], onProgress: (share: number) => void, signal?: AbortSignal): Promise<OpenedCt> {
  const host = new VolumeWorkerHost();
  try {
    const opened = await host.call({ call: "open", files }, (answer) => ("opened" in answer ? answer.opened : undefined), onProgress, signal);
    return {
      ...opened,
      read: (id, onShare, readSignal) => host.call({ call: "read", id }, (answer) => ("volume" in answer ? answer.volume : undefined), onShare, readSignal),
      close: () => host.close(),
    };
  } catch (error) {
    host.close();
    throw error;
  }
}

/** Reads a label map: .nrrd, .seg.nrrd, .nii, .nii.gz or .mha. Rejects with one sentence. */
export async function openLabels(file: File): Promise<LabelMap> {
  const host = new VolumeWorkerHost();
  try {
    return await host.call({ call: "labels", file: { path: file.name, file } }, (answer) => ("labels" in answer ? answer.labels : undefined), () => {});
  } finally {
    host.close();
  }
}

export { nrrdOf, nrrdOfLabels } from "./nrrd_file";
