// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Pose } from "../geometry/pose";
import { type Answer, type Evaluation, openAnswers } from "./answer_engine";

// Runs as a classic worker, from text that lies in the page: a file that was opened from disk may have no other.

/** What the page says; of each the worker answers with one Reply. */
export type Request = { bytes: Uint8Array<ArrayBuffer> } | { poses: Pose[] };
export type Reply = { answer: Answer | null } | { problem: string };

let evaluation: Promise<Evaluation> | null = null;

async function reply(request: Request): Promise<Reply> {
  try {
    if ("bytes" in request) evaluation = openAnswers(request.bytes);
    const open = await evaluation;
    return { answer: "poses" in request && open !== null ? open(request.poses) : null };
  } catch (thrown) {
    return { problem: String(thrown) };
  }
}

addEventListener("message", (event: MessageEvent<Request>) => {
  void reply(event.data).then((answer) => postMessage(answer));
});
