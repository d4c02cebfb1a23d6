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
  /** By WebAssembly. */
  isFast: boolean;
}

/** `bytes` stay the caller's. In the page itself where the browser has no workers. */
export async function startEngine(bytes: Uint8Array<ArrayBuffer>): Promise<Engine> {
  try {
    return await startWorker(bytes);
  } catch {
    const { evaluate, isFast } = await openAnswers(bytes);
    return { ask: async (poses) => evaluate(poses), isInWorker: false, isFast };
  }
}

async function startWorker(bytes: Uint8Array<ArrayBuffer>): Promise<Engine> {
  if (typeof Worker === "undefined") throw new Error("no workers");
  const worker = new AnswersWorker();
  const waiting: { accept: (reply: Reply) => void; reject: (error: Error) => void }[] = [];
  worker.onerror = () => waiting.splice(0).forEach(({ reject }) => reject(new Error("the worker has ended")));
  worker.onmessage = ({ data }: MessageEvent<Reply>) => {
    if ("problem" in data) waiting.shift()?.reject(new Error(data.problem));
    else waiting.shift()?.accept(data);
  };
  const send = (request: Request) =>
    new Promise<Reply>((accept, reject) => {
      waiting.push({ accept, reject });
      worker.postMessage(request);
    });
  const opened = await send({ bytes });
  const ask = async (poses: Pose[]) => {
    const reply = await send({ poses });
    return "answer" in reply ? reply.answer : null;
  };
  return { ask, isInWorker: true, isFast: "isFast" in opened && opened.isFast };
}
