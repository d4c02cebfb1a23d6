// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { openCtHere } from "./ct_input";
import type { FromVolumeWorker, OpenedCt, ToVolumeWorker } from "./opened_ct";
import { LocalReader } from "./pixel_readers";
import { readLabels } from "./volume_file";

const scope = globalThis as unknown as {
  onmessage: ((event: MessageEvent<ToVolumeWorker>) => void) | null;
  postMessage(message: FromVolumeWorker, transfer?: Transferable[]): void;
};
let opened: OpenedCt | null = null;
const pixels = new LocalReader();
let running = new AbortController();

/** A file of a thousand need not send a thousand messages. */
function progress(number: number): (share: number) => void {
  let sent = 0;
  return (share) => {
    if (share < 1 && share - sent < 0.01) return;
    sent = share;
    scope.postMessage({ share, number });
  };
}

async function answer(message: ToVolumeWorker, signal: AbortSignal): Promise<void> {
  const { number } = message;
  if (message.call === "open") {
    opened = await openCtHere(message.files, progress(number), signal);
    const { series, proposed, notes } = opened;
    scope.postMessage({ opened: { series, proposed, notes }, number });
  } else if (message.call === "read" && opened !== null) {
    const volume = await opened.read(message.id, progress(number), signal);
    scope.postMessage({ volume, number }, [volume.values.buffer]);
  } else if (message.call === "labels") {
    const labels = await readLabels(message.file);
    scope.postMessage({ labels, number }, [labels.values.buffer]);
  } else if (message.call === "pixels") {
    const images = await pixels.read(message.slices);
    scope.postMessage({ images, number }, images.map(({ buffer }) => buffer));
  }
}

scope.onmessage = ({ data }) => {
  running.abort();
  if (data.call === "cancel") return;
  running = new AbortController();
  const { signal } = running;
  answer(data, signal).catch((error: unknown) => {
    // An error of the machine (memory) has a text of its own; no error of ours holds anything of a file.
    if (!signal.aborted) scope.postMessage({ error: error instanceof Error ? error.message : "the CT cannot be read; try another browser", number: data.number });
  });
};
