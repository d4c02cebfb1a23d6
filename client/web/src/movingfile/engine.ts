// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Pose } from "../geometry/pose";
import { type Answer, openAnswers } from "./answer_engine";
import AnswersWorker from "./answers_worker?worker&inline";
import type { Reply, Request } from "./answers_worker";

/** Answers poses, one after the other. */
export interface Engine {
  ask(poses: Pose[]): Promise<Answer | null>;
  /** Beside the page, so that it never waits. */
  isInWorker: boolean;
}

/** `bytes` stay the caller's. In the page itself where the browser has no workers. */
export async function startEngine(bytes: Uint8Array<ArrayBuffer>): Promise<Engine> {
  try {
    return await startWorker(bytes);
  } catch {
    const evaluation = await openAnswers(bytes);
    return { ask: async (poses) => evaluation(poses), isInWorker: false };
  }
}

async function startWorker(bytes: Uint8Array<ArrayBuffer>): Promise<Engine> {
  if (typeof Worker === "undefined") throw new Error("no workers");
  const worker = new AnswersWorker();
  const waiting: { accept: (answer: Answer | null) => void; reject: (error: Error) => void }[] = [];
  worker.onerror = () => waiting.splice(0).forEach(({ reject }) => reject(new Error("the worker has ended")));
  worker.onmessage = ({ data }: MessageEvent<Reply>) => {
    const next = waiting.shift();
    if ("problem" in data) next?.reject(new Error(data.problem));
    else next?.accept(data.answer);
  };
  const send = (request: Request) =>
    new Promise<Answer | null>((accept, reject) => {
      waiting.push({ accept, reject });
      worker.postMessage(request);
    });
  await send({ bytes });
  return { ask: (poses) => send({ poses }), isInWorker: true };
}
