// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Pose } from "../geometry/pose";
import { type Answer, type OpenAnswers, openAnswers } from "./answer_engine";

// Runs as a classic worker, from text that lies in the page: a file that was opened from disk may have no other.

/** What the page says: the answers first, then poses. Of each the worker answers with one Reply. */
export type Request = { bytes: Uint8Array<ArrayBuffer>; module: WebAssembly.Module } | { poses: Pose[] };
export type Reply = { isOpen: true } | { answer: Answer | null } | { problem: string };

let open: OpenAnswers | null = null;

async function reply(request: Request): Promise<Reply> {
  try {
    if ("poses" in request) return { answer: open?.evaluate(request.poses) ?? null };
    open = await openAnswers(request.bytes, request.module);
    return { isOpen: true };
  } catch (thrown) {
    return { problem: String(thrown) };
  }
}

addEventListener("message", (event: MessageEvent<Request>) => {
  void reply(event.data).then((answer) => postMessage(answer));
});
