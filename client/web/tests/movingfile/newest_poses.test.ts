// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { expect, test } from "vitest";
import type { Pose } from "../../src/geometry/pose";
import type { Answer } from "../../src/movingfile/answer_engine";
import type { Reply, Request } from "../../src/movingfile/answers_worker";
import { type Engine, type WorkerLike, startEngine } from "../../src/movingfile/engine";
import { NewestPoses } from "../../src/movingfile/newest_poses";

const posesAt = (mm: number): Pose[] => [{ rotationVector: [0, 0, 0], pivotMm: [0, 0, 0], translationMm: [mm, 0, 0], scale: 1 }];
const ANSWER: Answer = { positions: new Float32Array(3), errorBoundMm: 0, isEstimate: false, uncertainty: null };

/** Answers the load; what is asked then waits until `reply` or `fail`. */
class FakeWorker implements WorkerLike {
  onmessage: Worker["onmessage"] = null;
  onerror: Worker["onerror"] = null;
  isTerminated = false;
  readonly asked: number[] = [];

  postMessage(request: Request): void {
    if ("bytes" in request) queueMicrotask(() => this.reply({ isOpen: true }));
    else this.asked.push(request.poses[0].translationMm[0]);
  }

  terminate(): void {
    this.isTerminated = true;
  }

  reply(data: Reply): void {
    this.onmessage?.call(this as never, { data } as MessageEvent);
  }

  fail(): void {
    this.onerror?.call(this as never, {} as ErrorEvent);
  }
}

function follow(engine: Engine) {
  const reported: (number | string)[] = [];
  const newest = new NewestPoses(engine, {
    onAnswer: (poses, answer) => reported.push(answer === null ? "beyond" : poses[0].translationMm[0]),
    onFailed: (thrown) => reported.push(String(thrown)),
  });
  return { reported, newest };
}

async function started() {
  const worker = new FakeWorker();
  const engine = await startEngine(new Uint8Array(), () => worker);
  expect(engine.isInWorker).toBe(true);
  return { worker, ...follow(engine) };
}

test("one question at a time, and of those that wait the newest", async () => {
  const { worker, reported, newest } = await started();
  [1, 2, 3].forEach((mm) => void newest.ask(posesAt(mm)));
  expect([worker.asked, newest.isIdle]).toEqual([[1], false]);
  worker.reply({ answer: ANSWER });
  await expect.poll(() => worker.asked).toEqual([1, 3]);
  worker.reply({ answer: null });
  await expect.poll(() => newest.isIdle).toBe(true);
  expect(reported).toEqual([1, "beyond"]);
});

test("an answer that fails is reported, and the next question is asked", async () => {
  const { worker, reported, newest } = await started();
  const asking = newest.ask(posesAt(1));
  worker.reply({ problem: "no memory" });
  await asking;
  expect([reported, newest.isIdle]).toEqual([["Error: no memory"], true]);
  void newest.ask(posesAt(2));
  worker.reply({ answer: ANSWER });
  await expect.poll(() => reported).toEqual(["Error: no memory", 2]);
});

test("a worker that ends leaves no question open, neither one that it had nor one after it", async () => {
  const { worker, reported, newest } = await started();
  const asking = newest.ask(posesAt(1));
  worker.fail();
  await asking;
  await newest.ask(posesAt(2));
  expect(reported).toEqual(["Error: the worker has ended", "Error: the worker has ended"]);
  expect([newest.isIdle, worker.isTerminated, worker.asked]).toEqual([true, true, [1]]);
});
