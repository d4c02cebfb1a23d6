// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { create } from "@bufbuild/protobuf";
import { CallError, Code, toCallError } from "../calls/call_error";
import { type Gateway, sessionMetadata } from "../calls/gateway";
import { type DeformConfiguration, type GetPreparedAnswersRequest, GetPreparedAnswersRequestSchema } from "../generated/tissueform/v1/deform_service_pb";
import { Backoff } from "../calls/backoff";
import { steady } from "../calls/steady";

/** More than any head needs; what is larger stays on the server. */
const MOST_BYTES = 2 ** 26;
/** How often a download that breaks off goes on without having brought anything. */
const MOST_TRIES = 6;
/** They may have to be made. */
const DEADLINE_MS = 300_000;

export interface FetchedColumns {
  bytes: Uint8Array;
  sha256: string;
}

export interface FetchOptions {
  /** The SHA-256 of what the page has; "" for nothing. */
  known: string;
  onProgress(share: number): void;
  signal: AbortSignal;
  wait?(ms: number): Promise<void>;
}

/**
 * The columns from which a drag with this configuration is answered; null where they are those that the page has. Goes on where a
 * line broke off. Rejects with a CallError.
 */
export async function fetchColumns(gateway: Pick<Gateway, "deform">, configuration: DeformConfiguration, options: FetchOptions): Promise<FetchedColumns | null> {
  const { signal, wait = (ms: number) => new Promise<void>((resolve) => setTimeout(resolve, ms)) } = options;
  const download = new Download(options.known, (share) => options.onProgress(share));
  const backoff = new Backoff();
  for (let tries = 0; ; ) {
    const before = download.done;
    try {
      const { session, vertices, model, prepared } = configuration;
      const request = create(GetPreparedAnswersRequestSchema, { session, vertices, model, prepared, readOffset: BigInt(before) });
      return await download.run(gateway, request, signal);
    } catch (thrown) {
      const error = toCallError(thrown);
      // A session that moves is somewhere else within seconds: that is not the line's fault.
      tries = download.done > before || error.isElsewhere ? 0 : tries + 1;
      if (signal.aborted || !error.isPassing || tries >= MOST_TRIES) throw error;
      await wait(backoff.next(error));
    }
  }
}

/** Aborted with the first of them. */
function anyOf(signal: AbortSignal, other: AbortSignal): AbortSignal {
  const both = new AbortController();
  for (const one of [signal, other]) {
    if (one.aborted) both.abort(one.reason);
    one.addEventListener("abort", () => both.abort(one.reason), { signal: both.signal });
  }
  return both.signal;
}

class Download {
  done = 0;
  private bytes = new Uint8Array();
  private sha256 = "";

  constructor(
    private readonly known: string,
    private readonly onProgress: (share: number) => void,
  ) {}

  async run(gateway: Pick<Gateway, "deform">, request: GetPreparedAnswersRequest, signal: AbortSignal): Promise<FetchedColumns | null> {
    const options = { headers: sessionMetadata(request.session), timeoutMs: DEADLINE_MS };
    const start = (stalled: AbortSignal) => gateway.deform.getPreparedAnswers(request, { ...options, signal: anyOf(signal, stalled) });
    for await (const { message } of steady(start, { firstMs: DEADLINE_MS })) {
      if (message.case === "header") this.begin(Number(message.value.totalBytes), message.value.sha256);
      if (message.case === "chunk") this.take(Number(message.value.offset), message.value.data);
      if (this.sha256 === this.known && this.known !== "") return null;
    }
    if (this.sha256 === "" || this.done !== this.bytes.length) throw new CallError(Code.Unavailable, "the columns are incomplete");
    return { bytes: this.bytes, sha256: this.sha256 };
  }

  private begin(totalBytes: number, sha256: string): void {
    if (!(totalBytes >= 0 && totalBytes <= MOST_BYTES)) throw new CallError(Code.ResourceExhausted, `the columns have ${totalBytes} bytes; this page takes ${MOST_BYTES}`);
    if (sha256 === this.sha256) return;
    const isOther = this.sha256 !== "";
    this.sha256 = sha256;
    this.bytes = new Uint8Array(totalBytes);
    this.done = 0;
    if (isOther) throw new CallError(Code.Unavailable, "the session has changed; its columns are fetched again");
  }

  private take(offset: number, data: Uint8Array): void {
    if (offset !== this.done || offset + data.length > this.bytes.length) throw new CallError(Code.DataLoss, "the columns are not contiguous");
    this.bytes.set(data, offset);
    this.done += data.length;
    this.onProgress(this.done / this.bytes.length);
  }
}
