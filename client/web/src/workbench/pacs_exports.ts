// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { create } from "@bufbuild/protobuf";
import { type CallError, Code, toCallError } from "../calls/call_error";
import type { CallSocket } from "../calls/call_socket";
import type { Gateway } from "../calls/gateway";
import { type Export, ExportService, ExportState, type Measure, WatchExportsRequestSchema } from "../generated/tissueform/v1/export_service_pb";
import type { Prediction } from "../generated/tissueform/v1/prediction_pb";
import { Backoff, type Timer, browserTimer } from "../calls/backoff";
import { randomId } from "../live/session_opening";
import { Signal } from "./signal";

const PAGE_SIZE = 200;

/** Which predictions of a case are on their way to the PACS, or there. Hears of it from the server until `close`. */
export class PacsExports {
  /** By prediction its newest export; null: the server sends nothing to a PACS, or has not reported yet. */
  readonly byPrediction = new Signal<ReadonlyMap<string, Export> | null>(null);

  private readonly backoff = new Backoff();
  private call: CallSocket<typeof ExportService.method.watchExports> | null = null;
  private stopTimer: (() => void) | null = null;
  private isClosed = false;

  constructor(
    private readonly gateway: Pick<Gateway, "open"> & { exports: Pick<Gateway["exports"], "createExport" | "deleteExport" | "listExports"> },
    private readonly caseName: string,
    private readonly timer: Timer = browserTimer,
  ) {}

  start(): void {
    this.call = this.gateway.open(ExportService.method.watchExports, {
      onMessage: (message) => (message.export === undefined ? this.refresh() : this.take([message.export])),
      onEnd: (error) => this.broken(error),
    });
    this.call.send(create(WatchExportsRequestSchema));
    this.call.halfClose();
  }

  /** Reports nothing afterwards. */
  close(): void {
    this.isClosed = true;
    this.stopTimer?.();
    this.call?.cancel();
  }

  /** Asks for it, with what was measured. Rejects with a CallError. */
  async send(prediction: Prediction, measures: Measure[]): Promise<void> {
    try {
      this.take([await this.gateway.exports.createExport({ prediction: prediction.name, measures, requestId: randomId() })]);
    } catch (thrown) {
      throw toCallError(thrown);
    }
  }

  /** Rejects with a CallError. */
  async takeBack(entry: Export): Promise<void> {
    try {
      await this.gateway.exports.deleteExport({ name: entry.name });
    } catch (thrown) {
      throw toCallError(thrown);
    }
    const left = new Map(this.byPrediction.value);
    if (left.get(entry.prediction)?.name === entry.name) left.delete(entry.prediction);
    this.byPrediction.value = left;
  }

  // Unfinished exports have come by then; the list shows which others are finished or gone since then.
  private refresh(): void {
    this.backoff.succeeded();
    this.list().then(
      (all) => {
        if (this.isClosed) return;
        const names = new Set(all.map(({ name }) => name));
        const known = Array.from(this.byPrediction.value?.values() ?? []).filter(({ name }) => names.has(name));
        this.byPrediction.value = new Map(known.map((entry) => [entry.prediction, entry]));
        this.take(all);
      },
      () => {}, // asked again at the next message
    );
  }

  private async list(): Promise<Export[]> {
    const all: Export[] = [];
    let pageToken = "";
    do {
      const page = await this.gateway.exports.listExports({ pageSize: PAGE_SIZE, pageToken, case: this.caseName });
      all.push(...page.exports);
      pageToken = page.nextPageToken;
    } while (pageToken !== "");
    return all;
  }

  private take(entries: readonly Export[]): void {
    const next = new Map(this.byPrediction.value);
    for (const entry of entries) {
      const known = next.get(entry.prediction);
      if (entry.case === this.caseName && (known === undefined || isNewer(entry, known))) next.set(entry.prediction, entry);
    }
    this.byPrediction.value = next;
  }

  private broken(error: CallError | null): void {
    if (this.isClosed) return;
    // The server is too old for this call, or the user may not make it.
    if (error !== null && !error.isPassing && error.code !== Code.ResourceExhausted) {
      this.byPrediction.value = null;
      return;
    }
    this.stopTimer = this.timer(() => this.start(), this.backoff.next());
  }
}

/** Names rise with the creation, etags with every change. */
function isNewer(entry: Export, known: Export): boolean {
  return entry.name === known.name ? Number(entry.etag) > Number(known.etag) : entry.name > known.name;
}

/** "stored, 7 objects": the state of the export, for the surgeon. */
export function exportText({ state, detail, storedObjects }: Export): string {
  const objects = `${storedObjects} ${storedObjects === 1 ? "object" : "objects"}`;
  if (state === ExportState.WAITING) return detail === "" ? "waiting for the bridge" : `waiting: ${detail}`;
  if (state === ExportState.CONFIRMATION) return "waits for confirmation on the review page";
  if (state === ExportState.STORING) return `storing, ${objects} so far`;
  if (state === ExportState.STORED) return `stored, ${objects}`;
  return detail === "" ? "failed" : `failed: ${detail}`;
}

/** It may be asked for: never was, or failed. */
export function maySend(entry: Export | undefined): boolean {
  return entry === undefined || entry.state === ExportState.FAILED;
}

/** Nothing of it is in the PACS yet. */
export function mayTakeBack(entry: Export | undefined): entry is Export {
  return entry?.state === ExportState.WAITING || entry?.state === ExportState.CONFIRMATION;
}
