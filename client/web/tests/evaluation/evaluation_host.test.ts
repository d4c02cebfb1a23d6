// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { createHash } from "node:crypto";
import { expect, test } from "vitest";
import { type HostListener, type WorkerLike, makeHost } from "../../src/evaluation/evaluation_host";
import { EvaluationService, type FromWorker, type ToWorker } from "../../src/evaluation/evaluation_service";
import { goldenBytes, goldenCases } from "./golden_answers";

const BYTES = goldenBytes("neo_hookean");
const SHA256 = createHash("sha256").update(BYTES).digest("hex");
const CASES = goldenCases("neo_hookean");

/** A worker in this process; `medianMs`: what it says its evaluations take. Answers wait until they are let out. */
class FakeWorker implements WorkerLike {
  onmessage: Worker["onmessage"] = null;
  onerror: Worker["onerror"] = null;
  isTerminated = false;
  readonly taken: ToWorker[] = [];
  private readonly waiting: FromWorker[] = [];
  private readonly service = new EvaluationService((message) => this.answer(message));

  constructor(private readonly medianMs: number) {}

  postMessage(message: ToWorker): void {
    this.taken.push(message);
    void this.service.take(message);
  }

  terminate(): void {
    this.isTerminated = true;
  }

  fail(): void {
    this.onerror?.call(this as never, {} as ErrorEvent);
  }

  letOut(): void {
    this.waiting.splice(0).forEach((message) => this.deliver(message));
  }

  private answer(message: FromWorker): void {
    if (message.kind === "evaluated") this.waiting.push(message);
    else this.deliver(message.kind === "ready" ? { ...message, medianMs: this.medianMs } : message);
  }

  private deliver(data: FromWorker): void {
    this.onmessage?.call(this as never, { data } as MessageEvent);
  }
}

function listener() {
  const reported: { number: number; coverage: string; first: number }[] = [];
  const ends: string[] = [];
  const listening: HostListener = {
    onEvaluation: ({ coverage, positions }, number) => reported.push({ number, coverage, first: positions[0] }),
    onEnded: () => ends.push("ended"),
  };
  return { reported, ends, listening };
}

test("fast columns are evaluated in the page, before the question returns", async () => {
  const worker = new FakeWorker(0.5);
  const { reported, listening } = listener();
  const host = await makeHost(BYTES, SHA256, listening, () => worker);
  expect([host.place, host.hasWorkers]).toEqual(["page", true]);
  expect(worker.isTerminated).toBe(true);
  host.ask(CASES[1].poses, 7);
  expect(reported).toHaveLength(1);
  expect(reported[0]).toMatchObject({ number: 7, coverage: "covered" });
  expect(reported[0].first).toBeCloseTo(CASES[1].positionsMm[0], 4);
});

test("slow columns are evaluated by the worker, the newest question only", async () => {
  const worker = new FakeWorker(20);
  const { reported, listening } = listener();
  const host = await makeHost(BYTES, SHA256, listening, () => worker);
  expect(host.place).toBe("worker");
  [1, 2, 3].forEach((number) => host.ask(CASES[number].poses, number));
  expect(reported).toEqual([]);
  worker.letOut();
  worker.letOut();
  expect(reported.map(({ number }) => number)).toEqual([1, 3]);
  expect(reported[1].first).toBeCloseTo(CASES[3].positionsMm[0], 4);
  host.close();
  host.ask(CASES[2].poses, 4);
  worker.letOut();
  expect(reported).toHaveLength(2);
});

test.each([["the page", 0.5], ["a worker", 20]])("the band of other poses comes from %s, and does not reach listeners for answers", async (_, medianMs) => {
  const bytes = goldenBytes("linear_elastic_band");
  const cases = goldenCases("linear_elastic_band");
  const { reported, listening } = listener();
  const worker = new FakeWorker(medianMs);
  const host = await makeHost(bytes, createHash("sha256").update(bytes).digest("hex"), listening, () => worker);
  const [one, other] = await Promise.all([host.valuesAt(cases[1].poses, "band"), host.valuesAt(cases[2].poses, "band")]);
  for (const [band, { bandMm }] of [[one, cases[1]], [other, cases[2]]] as const) {
    expect(band?.length).toBe(bandMm?.length);
    bandMm?.forEach((mm, vertex) => expect(Math.abs((band?.[vertex] ?? NaN) - mm)).toBeLessThan(2e-3));
  }
  expect(reported).toEqual([]);
});

test("columns without a band have none, and a pending request ends empty when the host closes", async () => {
  const host = await makeHost(BYTES, SHA256, listener().listening, () => null);
  expect(await host.valuesAt(CASES[1].poses, "band")).toBeNull();
  const worker = new FakeWorker(20);
  const beside = await makeHost(BYTES, SHA256, listener().listening, () => worker);
  worker.postMessage = () => {};
  const waiting = beside.valuesAt(CASES[1].poses, "band");
  beside.close();
  expect(await waiting).toBeNull();
});

test("a worker that ends by itself is reported, and leaves no request pending", async () => {
  const worker = new FakeWorker(20);
  const { reported, ends, listening } = listener();
  const host = await makeHost(BYTES, SHA256, listening, () => worker);
  host.ask(CASES[1].poses, 1);
  worker.postMessage = () => {};
  const waiting = host.valuesAt(CASES[1].poses, "band");
  worker.fail();
  expect([await waiting, await host.valuesAt(CASES[1].poses, "band")]).toEqual([null, null]);
  expect(ends).toEqual(["ended"]);
  expect(worker.isTerminated).toBe(true);
  worker.letOut();
  expect(reported).toEqual([]);
});

test("a worker that cannot answer says so, and counts as ended", async () => {
  const worker = new FakeWorker(20);
  const { ends, listening } = listener();
  const host = await makeHost(BYTES, SHA256, listening, () => worker);
  host.ask([null, null] as never, 1);
  await expect.poll(() => ends).toEqual(["ended"]);
});

test("a browser without workers evaluates in the page", async () => {
  const { reported, listening } = listener();
  const host = await makeHost(BYTES, SHA256, listening, () => null);
  host.ask(CASES[7].poses, 1);
  expect([host.place, host.hasWorkers]).toEqual(["page", false]);
  expect(reported[0].coverage).toBe("beyond");
});

test("a worker that does not start is done without", async () => {
  const worker = new FakeWorker(0);
  worker.postMessage = () => worker.fail();
  const host = await makeHost(BYTES, SHA256, listener().listening, () => worker);
  expect(host.place).toBe("page");
});

test.each([
  ["cut off", BYTES.slice(0, 5000), createHash("sha256").update(BYTES.slice(0, 5000)).digest("hex"), "incomplete or damaged"],
  ["of another hash", BYTES, SHA256.replace(/^../, "zz"), "announced SHA-256"],
])("bytes that are %s are refused, by a worker and without", async (_what, bytes, sha256, words) => {
  const worker = new FakeWorker(0);
  await expect(makeHost(bytes, sha256, listener().listening, () => worker)).rejects.toThrow(words);
  expect(worker.isTerminated).toBe(true);
  await expect(makeHost(bytes, sha256, listener().listening, () => null)).rejects.toThrow(words);
});
