// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { create, toBinary } from "@bufbuild/protobuf";
import { anyPack } from "@bufbuild/protobuf/wkt";
import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { Bearer } from "../../src/calls/bearer";
import { CallError, Code, toCallError } from "../../src/calls/call_error";
import { Gateway, sessionMetadata } from "../../src/calls/gateway";
import { repeated } from "../../src/calls/repetition";
import { ErrorInfoSchema } from "../../src/generated/google/rpc/error_details_pb";
import { StatusSchema } from "../../src/generated/google/rpc/status_pb";
import { DeformService, GetPreparedAnswersResponseSchema } from "../../src/generated/tissueform/v1/deform_service_pb";
import { SessionSchema } from "../../src/generated/tissueform/v1/session_pb";
import { FakeSocket } from "../testing/fake_socket";

beforeEach(() => vi.useFakeTimers({ toFake: ["setTimeout", "clearTimeout", "performance"] }));
afterEach(() => {
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

const TYPE = { "content-type": "application/grpc-web+proto" };

function details(code: Code, reason: string, node: string): string {
  const info = create(ErrorInfoSchema, { reason, domain: "tissueform", metadata: node === "" ? {} : { node } });
  const status = toBinary(StatusSchema, create(StatusSchema, { code, details: [anyPack(ErrorInfoSchema, info)] }));
  return Buffer.from(status).toString("base64");
}

/** What a server answers with: an error. */
function failure(code: Code, reason = "", node = ""): () => Response {
  const fields = { ...TYPE, "grpc-status": String(code), "grpc-message": "no", ...(reason === "" ? {} : { "grpc-status-details-bin": details(code, reason, node) }) };
  return () => new Response(null, { status: 200, headers: fields });
}

function framed(flag: number, payload: Uint8Array): Uint8Array {
  const bytes = new Uint8Array(5 + payload.length);
  bytes[0] = flag;
  new DataView(bytes.buffer).setUint32(1, payload.length);
  bytes.set(payload, 5);
  return bytes;
}

/** A message, then the end. `node`: who says so. */
function success(node: string, message: Uint8Array = toBinary(SessionSchema, create(SessionSchema)), trailers = "grpc-status: 0\r\n"): () => Response {
  const body = new Blob([framed(0, message), framed(0x80, new TextEncoder().encode(trailers))] as BlobPart[]);
  return () => new Response(body, { status: 200, headers: { ...TYPE, ...(node === "" ? {} : { "x-tissueform-node": node }) } });
}

/** A gateway whose servers answer in this order; the last answer stays. */
function gateway(...answers: (() => Response)[]) {
  const asked: { node: string | null; atMs: number }[] = [];
  const begin = performance.now();
  vi.stubGlobal("fetch", (_: string, { headers }: { headers: Headers }) => {
    asked.push({ node: headers.get("x-tissueform-node"), atMs: performance.now() - begin });
    return Promise.resolve((answers.length > 1 ? answers.shift() : answers[0])?.());
  });
  const sockets: FakeSocket[] = [];
  const calls = new Gateway("http://127.0.0.1", new Bearer(), () => {
    const socket = new FakeSocket();
    sockets.push(socket);
    return socket;
  });
  const options = { headers: sessionMetadata("sessions/s"), timeoutMs: 300_000 };
  const run = async <T>(call: Promise<T>): Promise<T> => {
    let isDone = false;
    const settled = call.finally(() => (isDone = true));
    settled.catch(() => {});
    for (let i = 0; i < 400 && !isDone; ++i) {
      await new Promise((done) => setImmediate(done));
      await vi.advanceTimersByTimeAsync(100);
    }
    return settled;
  };
  const read = () => run(calls.sessions.getSession({ name: "sessions/s" }, options));
  const remove = () => run(calls.sessions.deleteSession({ name: "sessions/s" }, options));
  const keep = () => run(calls.predictions.createPrediction({ session: "sessions/s", requestId: "r" }, options));
  const codeOf = (call: Promise<unknown>) => call.then(() => 0, (error: { code: Code }) => error.code);
  return { asked, calls, sockets, run, read, remove, keep, codeOf, nodes: () => asked.map(({ node }) => node) };
}

test("a session's calls name the server that has answered first", async () => {
  const { read, nodes } = gateway(success("a"));
  await read();
  await read();
  expect(nodes()).toEqual([null, "a"]);
});

test("a server that names the session's holder redirects any call at once", async () => {
  const { read, remove, asked, nodes } = gateway(failure(14, "SESSION_MOVED", "b"), success("b"), failure(14, "SESSION_MOVED", "c"), success("c"));
  await read();
  await remove();
  expect(nodes()).toEqual([null, "b", "b", "c"]);
  expect(asked[1].atMs - asked[0].atMs).toBeLessThan(100);
});

test("servers that send a call round in a circle are left alone for a while", async () => {
  const { read, asked, codeOf } = gateway(failure(14, "SESSION_MOVED", "a"));
  expect(await codeOf(read())).toBe(Code.Unavailable);
  // Five at a time, and 15 s; a timer rounds each wait up to a millisecond.
  expect(asked.length).toBeLessThan(150);
  expect(asked[asked.length - 1].atMs).toBeLessThan(15_000 + asked.length);
});

test("a wrong node is dropped, and the call goes wherever it goes", async () => {
  const { calls, read, nodes } = gateway(failure(14, "WRONG_NODE"), success("b"));
  calls.routes.learn("s", "a");
  await read();
  await read();
  expect(nodes()).toEqual(["a", null, "b"]);
});

test("calls that only read, or have a request id, are repeated when the server dies", async () => {
  const { read, keep, nodes } = gateway(failure(14), failure(2), success("b"), failure(14), success("b"));
  await read();
  await keep();
  expect(nodes()).toEqual([null, null, null, "b", null]);
});

test.each([Code.Canceled, Code.Unknown, Code.Internal, Code.Unavailable])("a read that ends with code %i, though this page has not ended it, is tried again", async (code) => {
  const { calls, read, nodes } = gateway(failure(code), success("b"));
  calls.routes.learn("s", "a");
  await read();
  expect(nodes()).toEqual(["a", null]);
});

test("a call that this page cancels is not repeated, and does not change the route", async () => {
  const { calls, run, codeOf, asked } = gateway(failure(Code.Canceled));
  calls.routes.learn("s", "a");
  const call = calls.sessions.getSession({ name: "sessions/s" }, { headers: sessionMetadata("sessions/s"), signal: AbortSignal.abort() });
  expect(await codeOf(run(call))).toBe(Code.Canceled);
  expect(asked.length).toBeLessThanOrEqual(1);
  expect(calls.routes.nodeOf("s")).toBe("a");
});

test("a call that might run twice reports the error", async () => {
  const { remove, asked, codeOf } = gateway(failure(14), success(""));
  expect(await codeOf(remove())).toBe(Code.Unavailable);
  expect(asked).toHaveLength(1);
});

test("errors of the call itself are said at once", async () => {
  const { read, asked, codeOf } = gateway(failure(5, "SESSION_NOT_FOUND"));
  expect(await codeOf(read())).toBe(Code.NotFound);
  expect(asked).toHaveLength(1);
});

test("after 15 s the error is said", async () => {
  const { read, asked, codeOf } = gateway(failure(14));
  expect(await codeOf(read())).toBe(Code.Unavailable);
  expect(asked[asked.length - 1].atMs).toBeGreaterThan(9000);
  expect(asked[asked.length - 1].atMs).toBeLessThan(15_000);
});

test("patience begins when the server has failed, not when it was asked", async () => {
  let tries = 0;
  const ask = async () => {
    vi.advanceTimersByTime(20_000);
    if (++tries === 1) throw new CallError(Code.Unavailable, "gone");
    return tries;
  };
  const clock = { now: () => performance.now(), wait: async () => {} };
  expect(await repeated(ask, () => true, clock)).toBe(2);
});

test("a download learns its server, and forgets it when that dies on the way", async () => {
  const header = toBinary(GetPreparedAnswersResponseSchema, create(GetPreparedAnswersResponseSchema));
  const { calls, run, codeOf } = gateway(success("a", header), success("a", header, "grpc-status: 14\r\ngrpc-message: gone\r\n"));
  const download = async () => {
    for await (const _ of calls.deform.getPreparedAnswers({ session: "sessions/s" }, { headers: sessionMetadata("sessions/s") }));
  };
  await run(download());
  expect(calls.routes.nodeOf("s")).toBe("a");
  expect(await codeOf(run(download()))).toBe(Code.Unavailable);
  expect(calls.routes.nodeOf("s")).toBe("");
});

test("a socket names the server, learns it when it begins, and forgets it when that is gone", () => {
  const { calls, sockets } = gateway(success(""));
  const ends: (CallError | null)[] = [];
  const open = () => {
    calls.open(DeformService.method.deform, { onMessage: () => {}, onEnd: (error) => ends.push(error) }, { metadata: sessionMetadata("sessions/s") });
    const socket = sockets[sockets.length - 1];
    socket.onopen?.();
    return socket;
  };
  const first = open();
  expect(first.start()).toMatchObject({ metadata: { "x-tissueform-session": "s" }, tellsBegin: true });
  first.begin({ "x-tissueform-node": "a" });
  expect(calls.routes.nodeOf("s")).toBe("a");
  const second = open();
  expect(second.start().metadata["x-tissueform-node"]).toBe("a");
  second.onclose?.({ code: 1006, reason: "" });
  expect(ends[0]?.isPassing).toBe(true);
  expect(open().start().metadata["x-tissueform-node"]).toBeUndefined();
});

test("a socket that ends with where the session is leads the next one there", () => {
  const { calls, sockets } = gateway(success(""));
  const ends: (CallError | null)[] = [];
  const open = () => calls.open(DeformService.method.deform, { onMessage: () => {}, onEnd: (error) => ends.push(error) }, { metadata: sessionMetadata("sessions/s") });
  open();
  sockets[0].onopen?.();
  sockets[0].end(Code.ResourceExhausted, "full", Buffer.from(details(Code.ResourceExhausted, "MEMORY_BUDGET_FULL", "b"), "base64"));
  expect(ends[0]).toMatchObject({ node: "b", isPassing: true });
  open();
  sockets[1].onopen?.();
  expect(sockets[1].start().metadata["x-tissueform-node"]).toBe("b");
});

/** A browser whose kept connections are dead: the first `count` requests hang until they are aborted. */
function hanging(count: number, answer: () => Response) {
  const waitedMs: number[] = [];
  vi.stubGlobal("fetch", (_: string, { signal }: { signal: AbortSignal }) => {
    if (count-- <= 0) return Promise.resolve(answer());
    const begin = performance.now();
    return new Promise((_, reject) =>
      signal.addEventListener("abort", () => {
        waitedMs.push(performance.now() - begin);
        reject(signal.reason);
      }),
    );
  });
  return waitedMs;
}

test("a look that a dead connection swallows is made again over another one, with more patience", async () => {
  const { read, codeOf } = gateway(success("a"));
  const waitedMs = hanging(2, success("a"));
  expect(await codeOf(read())).toBe(0);
  expect(waitedMs).toEqual([4000, 8000]);
});

test("where all servers are dead the reason is reported, and the page stops asking", async () => {
  const { read } = gateway(success("a"));
  const waitedMs = hanging(Infinity, success("a"));
  const error = await read().catch((thrown) => toCallError(thrown));
  expect(error).toMatchObject({ code: Code.DeadlineExceeded, message: "the server has not answered for 16 s", isPassing: true });
  expect(waitedMs).toEqual([4000, 8000, 16000]);
});

test("a call that changes something, or may take long, is not cut short", async () => {
  const { remove, keep } = gateway(success("a"));
  for (const call of [remove, keep]) {
    const waitedMs = hanging(Infinity, success("a"));
    await expect(Promise.race([call(), new Promise((_, reject) => setTimeout(() => reject(new Error("still waiting")), 30_000))])).rejects.toThrow("still waiting");
    expect(waitedMs).toEqual([]);
  }
});
