// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { create } from "@bufbuild/protobuf";
import { createHash } from "node:crypto";
import { expect, test, vi } from "vitest";
import { CallError, Code } from "../../src/calls/call_error";
import type { Gateway } from "../../src/calls/gateway";
import { makeHost } from "../../src/evaluation/evaluation_host";
import { type DeformConfiguration, DeformConfigurationSchema, type GetPreparedAnswersRequest, PreparedAnswersSchema } from "../../src/generated/tissueform/v1/deform_service_pb";
import { fetchColumns } from "../../src/live/column_fetch";
import { LocalAnswers, type LocalState } from "../../src/live/local_answers";
import { goldenBytes, goldenCases } from "../evaluation/golden_answers";

const CHUNK = 7000;
const CASES = goldenCases("linear_elastic");
const sha256Of = (bytes: Uint8Array) => createHash("sha256").update(bytes).digest("hex");

/** A server that sends these bytes; `faults` is asked before every chunk, and throws. */
function server(bytes: () => Uint8Array, faults: (offset: number) => void = () => {}) {
  const offsets: number[] = [];
  async function* getPreparedAnswers(request: GetPreparedAnswersRequest, options: { signal: AbortSignal }) {
    offsets.push(Number(request.readOffset));
    const all = bytes();
    yield { message: { case: "header" as const, value: { totalBytes: BigInt(all.length), sha256: sha256Of(all) } } };
    for (let at = Number(request.readOffset); at < all.length; at += CHUNK) {
      faults(at);
      if (options.signal.aborted) throw new CallError(Code.Canceled, "cancelled");
      yield { message: { case: "chunk" as const, value: { offset: BigInt(at), data: all.subarray(at, at + CHUNK) } } };
    }
  }
  return { gateway: { deform: { getPreparedAnswers } } as unknown as Pick<Gateway, "deform">, offsets };
}

function configuration(session = "sessions/a", isPrepared = true): DeformConfiguration {
  return create(DeformConfigurationSchema, { session, model: 2, prepared: isPrepared ? create(PreparedAnswersSchema, {}) : undefined });
}

const options = (known = "") => ({ known, onProgress: () => {}, signal: new AbortController().signal, wait: async () => {} });

test("columns that break off go on where they did", async () => {
  const bytes = goldenBytes("linear_elastic");
  let faults = 2;
  const { gateway, offsets } = server(() => bytes, (at) => {
    if (at > CHUNK && faults-- > 0) throw new CallError(Code.Unavailable, "the line broke off");
  });
  const columns = await fetchColumns(gateway, configuration(), options());
  expect(columns?.bytes).toEqual(bytes);
  expect(offsets).toEqual([0, 2 * CHUNK, 2 * CHUNK]);
});

test("columns that changed meanwhile are fetched from their beginning", async () => {
  let bytes = goldenBytes("linear_elastic");
  const { gateway } = server(() => bytes, (at) => {
    if (at === 0 || bytes.length !== 38432) return;
    bytes = goldenBytes("gradient_field");
    throw new CallError(Code.Unavailable, "the line broke off");
  });
  expect((await fetchColumns(gateway, configuration(), options()))?.bytes).toEqual(goldenBytes("gradient_field"));
});

test("columns that the page has are not fetched again", async () => {
  const bytes = goldenBytes("linear_elastic");
  const { gateway } = server(() => bytes, () => {
    throw new Error("was read");
  });
  expect(await fetchColumns(gateway, configuration(), options(sha256Of(bytes)))).toBeNull();
});

test("a line that brings nothing is given up, what is refused at once", async () => {
  const broken = server(() => goldenBytes("linear_elastic"), () => {
    throw new CallError(Code.Unavailable, "the line broke off");
  });
  await expect(fetchColumns(broken.gateway, configuration(), options())).rejects.toThrow("broke off");
  expect(broken.offsets).toHaveLength(6);
  const refused = server(() => goldenBytes("linear_elastic"), () => {
    throw new CallError(Code.ResourceExhausted, "more bytes than are sent");
  });
  await expect(fetchColumns(refused.gateway, configuration(), options())).rejects.toThrow("more bytes");
  expect(refused.offsets).toHaveLength(1);
});

test.each([
  ["more than a page takes", 2n ** 26n + 1n, "67108865 bytes; this page takes 67108864"],
  ["less than none", -1n, "-1 bytes; this page takes 67108864"],
])("columns that say that they are %s are refused in a sentence, at once", async (_, totalBytes, words) => {
  let calls = 0;
  async function* getPreparedAnswers() {
    calls += 1;
    yield { message: { case: "header" as const, value: { totalBytes, sha256: "a" } } };
  }
  const gateway = { deform: { getPreparedAnswers } } as unknown as Pick<Gateway, "deform">;
  await expect(fetchColumns(gateway, configuration(), options())).rejects.toThrow(words);
  expect(calls).toBe(1);
});

function local(bytes: () => Uint8Array = () => goldenBytes("linear_elastic")) {
  const states: LocalState[] = [];
  const firsts: number[] = [];
  const { gateway, offsets } = server(bytes);
  const answers = new LocalAnswers(
    gateway,
    { onState: (state) => states.push(state), onEvaluation: ({ positions }) => firsts.push(positions[0]) },
    (data, sha256, listener) => makeHost(data, sha256, listener, () => null),
  );
  return { answers, states, firsts, offsets, last: () => states[states.length - 1] };
}

test("a pose is answered before the question returns, once the columns are there", async () => {
  const { answers, firsts, last } = local();
  answers.ask(CASES[1].poses);
  expect(answers.posesSinceShown).toBe(Infinity);
  await answers.follow(configuration());
  expect(firsts).toHaveLength(1);
  answers.ask(CASES[2].poses);
  expect(firsts).toHaveLength(2);
  expect(firsts[1]).toBeCloseTo(CASES[2].positionsMm[0], 4);
  expect(answers.posesSinceShown).toBe(0);
  expect(last()).toMatchObject({ kind: "ready", coverage: "covered", place: "page", hasWorkers: false });
});

test("beyond the range no answer is reported, and the age of the last one is known", async () => {
  const { answers, firsts, last } = local();
  await answers.follow(configuration());
  answers.ask(CASES[1].poses);
  answers.ask(CASES[7].poses);
  expect(firsts).toHaveLength(1);
  expect(answers.posesSinceShown).toBe(1);
  expect(last()).toMatchObject({ kind: "ready", coverage: "beyond" });
});

test("the same columns stay through a break of the line, others of an updated session replace them", async () => {
  let bytes = goldenBytes("linear_elastic");
  const { answers, firsts, offsets } = local(() => bytes);
  await answers.follow(configuration());
  await answers.follow(configuration());
  answers.ask(CASES[1].poses);
  expect(firsts).toHaveLength(1);
  bytes = goldenBytes("linear_elastic_band");
  await answers.follow(configuration());
  expect(offsets).toHaveLength(3);
  answers.drop();
  answers.ask(CASES[1].poses);
  expect(firsts).toHaveLength(1);
});

test("while the server is away the page goes on by what it has", async () => {
  vi.useFakeTimers({ toFake: ["setTimeout"] });
  try {
    let isAway = false;
    const { answers, firsts, offsets, last } = local(() => {
      if (isAway) throw new CallError(Code.Unavailable, "the server is gone");
      return goldenBytes("linear_elastic");
    });
    await answers.follow(configuration());
    isAway = true;
    let isOver = false;
    const following = answers.follow(configuration()).then(() => (isOver = true));
    while (!isOver) await vi.advanceTimersByTimeAsync(1000);
    await following;
    expect(offsets.length).toBeGreaterThan(2);
    answers.ask(CASES[1].poses);
    expect(firsts).toHaveLength(1);
    expect(last()).toMatchObject({ kind: "ready", coverage: "covered" });
  } finally {
    vi.useRealTimers();
  }
});

test("a model without prepared answers, and another session, leave the server to answer", async () => {
  const { answers, firsts, last } = local();
  await answers.follow(configuration());
  await answers.follow(configuration("sessions/a", false));
  answers.ask(CASES[1].poses);
  expect(firsts).toEqual([]);
  expect(last()).toEqual({ kind: "none" });
  expect(answers.posesSinceShown).toBe(Infinity);
});

test("after a stop the server answers until local answers are resumed", async () => {
  const { answers, firsts, last } = local();
  await answers.follow(configuration());
  answers.stop();
  await answers.follow(configuration());
  answers.ask(CASES[1].poses);
  expect(firsts).toEqual([]);
  expect(last()).toEqual({ kind: "stopped" });
  answers.resume();
  await expect.poll(() => firsts.length).toBe(1);
});

test("a worker that ends by itself leaves the server to answer until it is asked for anew", async () => {
  const states: LocalState[] = [];
  const endings: (() => void)[] = [];
  const { gateway, offsets } = server(() => goldenBytes("linear_elastic"));
  const answers = new LocalAnswers(gateway, { onState: (state) => states.push(state), onEvaluation: () => {} }, async (_bytes, _sha256, listener) => {
    endings.push(() => listener.onEnded());
    return { place: "worker", hasWorkers: true, ask: () => {}, valuesAt: async () => null, placesAt: async () => null, close: () => {} };
  });
  await answers.follow(configuration());
  expect(states[states.length - 1]).toMatchObject({ kind: "ready", place: "worker" });
  endings[0]();
  expect(states[states.length - 1]).toMatchObject({ kind: "failed", text: expect.stringContaining("worker stopped") });
  expect([answers.heldColumns, await answers.bandAt(CASES[1].poses)]).toEqual([null, null]);
  answers.resume();
  await expect.poll(() => states[states.length - 1]).toMatchObject({ kind: "ready" });
  expect(offsets).toEqual([0, 0]);
});

test("damaged columns are reported in a sentence, and the server answers", async () => {
  const { answers, firsts, last } = local(() => goldenBytes("linear_elastic").slice(0, 20_000));
  await answers.follow(configuration());
  answers.ask(CASES[1].poses);
  expect(firsts).toEqual([]);
  expect(last()).toMatchObject({ kind: "failed", text: expect.stringContaining("incomplete or damaged") });
});
