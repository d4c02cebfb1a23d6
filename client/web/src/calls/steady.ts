// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type Timer, browserTimer } from "./backoff";
import { CallError, Code } from "./call_error";

/** Long enough for one message of 128 KiB over 35 kbit/s. */
const PATIENCE_MS = 30_000;

/**
 * The messages of a download, in their order. Aborts the call when no message comes for 30 s (the first one: for `firstMs`), and
 * throws a CallError that passes: the connection may be dead though neither side has closed it.
 */
export async function* steady<T>(start: (signal: AbortSignal) => AsyncIterable<T>, { firstMs = PATIENCE_MS, timer = browserTimer }: { firstMs?: number; timer?: Timer } = {}): AsyncGenerator<T> {
  const ending = new AbortController();
  let stalledMs = 0;
  const wait = (ms: number) =>
    timer(() => {
      stalledMs = ms;
      ending.abort();
    }, ms);
  let stop = wait(firstMs);
  try {
    for await (const message of start(ending.signal)) {
      stop();
      yield message;
      stop = wait(PATIENCE_MS);
    }
  } catch (thrown) {
    throw stalledMs === 0 ? thrown : new CallError(Code.Unavailable, `no data from the server for ${stalledMs / 1000} s`);
  } finally {
    stop();
    ending.abort();
  }
}
