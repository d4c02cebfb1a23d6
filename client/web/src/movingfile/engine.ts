// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { evaluatorModule } from "../evaluation/evaluator_module";
import type { Pose } from "../geometry/pose";
import { type Answer, openAnswers } from "./answer_engine";
import AnswersWorker from "./answers_worker?worker&inline";
import type { Reply, Request } from "./answers_worker";

/** Answers poses, one after the other. */
export interface Engine {
  /** Rejects where the worker cannot answer, or has ended. */
  ask(poses: Pose[]): Promise<Answer | null>;
  /** Beside the page, so that it never waits. */
  isInWorker: boolean;
}

/** What of a worker is used; tests have their own. */
export type WorkerLike = Pick<Worker, "onmessage" | "onerror" | "terminate"> & { postMessage(request: Request): void };

/** `bytes` stay the caller's. In the page itself where the browser has no workers. Rejects with a NoEvaluatorError without WebAssembly. */
export async function startEngine(bytes: Uint8Array<ArrayBuffer>, makeWorker: () => WorkerLike = answersWorker): Promise<Engine> {
  const module = await evaluatorModule();
  try {
    return await startWorker({ bytes, module }, makeWorker());
  } catch {
    const { evaluate } = await openAnswers(bytes, module);
    return { ask: async (poses) => evaluate(poses), isInWorker: false };
  }
}

function answersWorker(): WorkerLike {
  if (typeof Worker === "undefined") throw new Error("no workers");
  return new AnswersWorker();
}

async function startWorker(opening: Request, worker: WorkerLike): Promise<Engine> {
  const waiting: { accept: (reply: Reply) => void; reject: (error: Error) => void }[] = [];
  let hasEnded = false;
  const ended = () => new Error("the worker has ended");
  worker.onerror = () => {
    hasEnded = true;
    worker.terminate();
    waiting.splice(0).forEach(({ reject }) => reject(ended()));
  };
  worker.onmessage = ({ data }: MessageEvent<Reply>) => {
    if ("problem" in data) waiting.shift()?.reject(new Error(data.problem));
    else waiting.shift()?.accept(data);
  };
  const send = (request: Request) =>
    new Promise<Reply>((accept, reject) => {
      if (hasEnded) return reject(ended());
      waiting.push({ accept, reject });
      worker.postMessage(request);
    });
  await send(opening);
  const ask = async (poses: Pose[]) => {
    const reply = await send({ poses });
    return "answer" in reply ? reply.answer : null;
  };
  return { ask, isInWorker: true };
}
