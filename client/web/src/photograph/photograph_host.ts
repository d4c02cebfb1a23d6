// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { PhotographAnswer, PhotographQuestion } from "./photograph_worker";
import type { DroppedFile, ReadPhotograph } from "./read_photograph";
import type { Registration, RegistrationTask } from "./registration";

/** Reads in a worker. Rejects with an Error in a sentence. */
export async function readInWorker(files: DroppedFile[]): Promise<ReadPhotograph> {
  const answer = await ask({ kind: "read", files });
  if (answer.kind !== "read") throw new Error("the photograph could not be read: try again");
  return answer.read;
}

/** Registers in a worker. Rejects with an Error in a sentence. */
export async function registerInWorker(task: RegistrationTask): Promise<Registration> {
  const answer = await ask({ kind: "register", task });
  if (answer.kind !== "registered") throw new Error("the photograph could not be registered: try again");
  return answer.registration;
}

/** A worker for each question: what it holds is freed with it. */
function ask(question: PhotographQuestion): Promise<PhotographAnswer> {
  const worker = new Worker(new URL("./photograph_worker.ts", import.meta.url));
  return new Promise<PhotographAnswer>((resolve, reject) => {
    worker.onerror = () => reject(new Error("the photograph needs more memory than this page has, or its background thread did not start: use a smaller file, or reload the page"));
    worker.onmessage = ({ data }: MessageEvent<PhotographAnswer>) => (data.kind === "failed" ? reject(new Error(data.message)) : resolve(data));
    worker.postMessage(question);
  }).finally(() => worker.terminate());
}
