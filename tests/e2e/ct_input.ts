// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { DroppedFile, OpenedCt } from "../../client/web/src/volume/opened_ct";
import type { Volume } from "../../client/web/src/volume/volume";

interface Reader {
  openCt(files: readonly DroppedFile[], onProgress: (share: number) => void): Promise<OpenedCt>;
  nrrdOf(volume: Volume, onProgress: (share: number) => void): Promise<Blob>;
}
export type VolumeHook = { tissueform: { volume(): Promise<Reader> } };

/** Runs in the page: opens files (base64), reads the proposed series, and gives out what the page has of it. */
export async function readInPage(files: readonly { path: string; base64: string }[]) {
  const { openCt, nrrdOf } = await (globalThis as unknown as VolumeHook).tissueform.volume();
  const bytesOf = (base64: string) => Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
  const opened = await openCt(files.map(({ path, base64 }) => ({ path, file: new File([bytesOf(base64)], "x") })), () => {});
  const { series, proposed, notes } = opened;
  const volume = await opened.read(proposed!, () => {});
  opened.close();
  const nrrd = new Uint8Array(await (await nrrdOf(volume, () => {})).arrayBuffer());
  return { series, proposed, notes, grid: volume.grid, values: Array.from(volume.values), nrrd: Array.from(nrrd) };
}

/** Runs in the page: the message of a refused folder. */
export async function refusalInPage(files: readonly { path: string; base64: string }[]): Promise<string> {
  const { openCt } = await (globalThis as unknown as VolumeHook).tissueform.volume();
  const dropped = files.map(({ path, base64 }) => ({ path, file: new File([atob(base64)], "x") }));
  return openCt(dropped, () => {}).then(() => "", (error: Error) => error.message);
}

/** Runs in the page: opens and reads `count` slices that differ from the given one in their place, "0000.0" of its header, and measures. */
export async function timeInPage({ base64, count }: { base64: string; count: number }) {
  const { openCt } = await (globalThis as unknown as VolumeHook).tissueform.volume();
  const slice = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
  const place = new TextDecoder("latin1").decode(slice.subarray(0, 4096)).indexOf("0000.0");
  const files = Array.from({ length: count }, (_, k) => {
    slice.set(new TextEncoder().encode(`${k}.0`.padStart(6, "0")), place);
    return { path: `${k}`, file: new File([slice.slice()], "x") };
  });
  let longestPauseMs = 0;
  let last = performance.now();
  const ticks = setInterval(() => {
    longestPauseMs = Math.max(longestPauseMs, performance.now() - last);
    last = performance.now();
  }, 5);
  const begin = performance.now();
  const opened = await openCt(files, () => {});
  const openedMs = performance.now() - begin;
  const volume = await opened.read(opened.proposed!, () => {});
  const readMs = performance.now() - begin - openedMs;
  clearInterval(ticks);
  opened.close();
  return { slices: volume.grid.size[2], openedMs, readMs, longestPauseMs };
}
