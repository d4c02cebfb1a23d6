// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { ConnectError, type Interceptor, type StreamResponse } from "@connectrpc/connect";
import { Backoff, browserTimer } from "./backoff";
import { type CallError, Code, toCallError, unlessCancelled } from "./call_error";
import { NODE_HEADER, SESSION_HEADER, type SessionRoutes } from "./session_routes";

/** How long a call is tried again after it has failed first: longer than another server needs to take a session over. */
const PATIENCE_MS = 15_000;
/** Methods that do no more the second time than the first: they read, or carry an id of their request. */
const REPEATABLE = /^(Get|List|Query)[A-Z]|^(WhoAmI|DeformOnce|Fit|CreatePrediction|CreatePlanBuild)$/;
/** Of these such as only look something up. */
const QUICK = /^(Get|List|Query)[A-Z]|^WhoAmI$/;
/** How long the first try of a quick call may take, and the second twice as long. */
const QUICK_MS = 4000;

export interface RepetitionClock {
  now(): number;
  wait(ms: number): Promise<void>;
}

const BROWSER_CLOCK: RepetitionClock = {
  now: () => performance.now(),
  wait: (ms) => new Promise((resolve) => setTimeout(resolve, ms)),
};

/**
 * Sends calls over gRPC-Web to the server that holds their session, learns from what comes back where that is, and makes unary
 * calls again: at once where the answer says which server holds it, after a while where a server is gone. Any call that was refused
 * before anything was done is repeated; all others only where nothing is done twice.
 * A quick call that has no answer is made again over another connection: browsers keep connections, and one may be dead though
 * neither side has closed it.
 */
export function withRoutes(routes: SessionRoutes, clock: RepetitionClock = BROWSER_CLOCK): Interceptor {
  return (next) => async (request) => {
    const session = request.header.get(SESSION_HEADER) ?? "";
    const isQuick = QUICK.test(request.method.name) && !request.stream;
    let attemptMs = QUICK_MS;
    const ask = async () => {
      const node = routes.nodeOf(session);
      if (node === "") request.header.delete(NODE_HEADER);
      else request.header.set(NODE_HEADER, node);
      const onError = (thrown: unknown) => {
        const reported = request.signal.aborted ? thrown : unlessCancelled(thrown);
        routes.failed(session, node, toCallError(reported));
        return reported;
      };
      try {
        const response = await (isQuick ? answeredWithin(attemptMs, request.signal, (signal) => next({ ...request, signal })) : next(request));
        routes.learn(session, response.header.get(NODE_HEADER) ?? response.trailer.get(NODE_HEADER) ?? "");
        return response.stream ? { ...response, message: watched(response.message, onError) } : response;
      } catch (thrown) {
        attemptMs *= 2;
        throw onError(thrown);
      }
    };
    if (request.stream) return ask();
    const isSafe = REPEATABLE.test(request.method.name);
    return repeated(ask, (error) => !request.signal.aborted && (error.isElsewhere || (isSafe && (error.isOfServer || (isQuick && error.code === Code.DeadlineExceeded)))), clock);
  };
}

/** What `ask` resolves with; it is aborted with `outer`, and where it takes longer rejects with an error that passes. */
async function answeredWithin<T>(limitMs: number, outer: AbortSignal, ask: (signal: AbortSignal) => Promise<T>): Promise<T> {
  const attempt = new AbortController();
  const giveUp = () => attempt.abort(outer.reason);
  let isLate = false;
  outer.addEventListener("abort", giveUp);
  const stop = browserTimer(() => {
    isLate = true;
    attempt.abort();
  }, limitMs);
  try {
    return await ask(attempt.signal);
  } catch (thrown) {
    throw isLate ? new ConnectError(`the server has not answered for ${limitMs / 1000} s`, Code.DeadlineExceeded) : thrown;
  } finally {
    stop();
    outer.removeEventListener("abort", giveUp);
  }
}

/** What `ask` resolves with, which is called again while `mayRepeat` says so of its error, for up to 15 s. */
export async function repeated<T>(ask: () => Promise<T>, mayRepeat: (error: CallError) => boolean, clock: RepetitionClock = BROWSER_CLOCK): Promise<T> {
  const backoff = new Backoff();
  let end: number | null = null;
  for (;;) {
    try {
      return await ask();
    } catch (thrown) {
      const error = toCallError(thrown);
      const delay = backoff.next(error);
      end ??= clock.now() + PATIENCE_MS;
      if (!mayRepeat(error) || clock.now() + delay > end) throw thrown;
      await clock.wait(delay);
    }
  }
}

// A stream of answers ends within what the caller reads.
async function* watched(messages: StreamResponse["message"], onError: (thrown: unknown) => unknown) {
  try {
    yield* messages;
  } catch (thrown) {
    throw onError(thrown);
  }
}
