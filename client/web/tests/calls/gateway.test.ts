// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { afterEach, expect, test, vi } from "vitest";
import { Bearer } from "../../src/calls/bearer";
import { type CallError, Code } from "../../src/calls/call_error";
import { Gateway, baseOf } from "../../src/calls/gateway";
import { DeformService } from "../../src/generated/tissueform/v1/deform_service_pb";
import { FakeSocket } from "../testing/fake_socket";

afterEach(() => vi.unstubAllGlobals());

/** A gateway whose server takes the tokens of `good` only. */
function gateway(good: string[]) {
  const bearer = new Bearer();
  const sent: (string | null)[] = [];
  vi.stubGlobal("fetch", (_: string, { headers }: { headers: Headers }) => {
    const token = headers.get("authorization");
    sent.push(token);
    const isGood = token !== null && good.includes(token);
    const fields = { "content-type": "application/grpc-web+proto", "grpc-status": isGood ? "5" : "16", "grpc-message": isGood ? "not here" : "who are you" };
    return Promise.resolve(new Response(null, { status: 200, headers: fields }));
  });
  const sockets: FakeSocket[] = [];
  const calls = new Gateway("http://127.0.0.1", bearer, () => {
    const socket = new FakeSocket();
    sockets.push(socket);
    return socket;
  });
  const codeOf = () => calls.cases.getCase({ name: "cases/a" }).then(() => 0, (error: { code: Code }) => error.code);
  const open = () => {
    const ends: (CallError | null)[] = [];
    calls.open(DeformService.method.deform, { onMessage: () => {}, onEnd: (error) => ends.push(error) }, { metadata: { "x-tissueform-session": "abc" } });
    const socket = sockets[sockets.length - 1];
    socket.onopen?.();
    return { socket, ends };
  };
  return { bearer, sent, codeOf, open };
}

const settle = () => new Promise((done) => setImmediate(done));

test("a call without a login brings no token", async () => {
  const { sent, codeOf, open } = gateway([]);
  expect(await codeOf()).toBe(Code.Unauthenticated);
  expect(sent).toEqual([null]);
  expect(open().socket.start().metadata).toEqual({ "x-tissueform-session": "abc" });
});

test("every call brings the token of now", async () => {
  const { bearer, sent, codeOf, open } = gateway(["Bearer one", "Bearer two"]);
  bearer.token = "one";
  expect(await codeOf()).toBe(Code.NotFound);
  bearer.token = "two";
  await codeOf();
  expect(sent).toEqual(["Bearer one", "Bearer two"]);
  expect(open().socket.start().metadata).toEqual({ "x-tissueform-session": "abc", authorization: "Bearer two" });
});

test("a refused call is made once more with another token, and not again", async () => {
  const { bearer, sent, codeOf } = gateway(["Bearer two"]);
  bearer.token = "one";
  bearer.renewer = async () => {
    bearer.token = "two";
    return true;
  };
  expect(await codeOf()).toBe(Code.NotFound);
  expect(sent).toEqual(["Bearer one", "Bearer two"]);
  bearer.token = "three";
  bearer.renewer = async () => true;
  expect(await codeOf()).toBe(Code.Unauthenticated);
  expect(sent).toHaveLength(4);
});

test("a refused call that nobody mends is refused", async () => {
  const { bearer, sent, codeOf } = gateway([]);
  bearer.token = "one";
  bearer.renewer = async () => false;
  expect(await codeOf()).toBe(Code.Unauthenticated);
  expect(sent).toHaveLength(1);
});

test("a stream that is refused passes where there is another token, and ends where there is none", async () => {
  const { bearer, open } = gateway([]);
  bearer.token = "one";
  const first = open();
  bearer.token = "two";
  first.socket.end(Code.Unauthenticated, "the token has expired");
  await settle();
  expect(first.ends[0]?.isPassing).toBe(true);
  const second = open();
  second.socket.end(Code.Unauthenticated, "the token has expired");
  await settle();
  expect(second.ends[0]?.code).toBe(Code.Unauthenticated);
});

test("other ends of a stream are reported at once and unchanged", () => {
  const { open } = gateway([]);
  const { socket, ends } = open();
  socket.end(0);
  expect(ends).toEqual([null]);
});

test.each([
  [426, "a proxy blocks WebSockets"],
  [503, "the gateway takes no more connections"],
  [502, "the connection to the gateway does not open"],
  [0, "the connection to the gateway does not open"],
])("why a socket does not open is found out by a plain request (%i)", async (status, text) => {
  const asked: string[] = [];
  vi.stubGlobal("fetch", (url: string) => {
    asked.push(url);
    return status === 0 ? Promise.reject(new Error("gone")) : Promise.resolve(new Response(null, { status }));
  });
  const socket = new FakeSocket();
  const calls = new Gateway("https://hospital.example.org/planner", new Bearer(), () => socket);
  const ended = new Promise<CallError | null>((onEnd) => calls.open(DeformService.method.deform, { onMessage: () => {}, onEnd }));
  socket.onclose?.({ code: 1006, reason: "" });
  expect((await ended)?.message).toContain(text);
  expect((await ended)?.isPassing).toBe(true);
  expect(asked).toEqual(["https://hospital.example.org/planner/call"]);
});

test.each([
  ["http://127.0.0.1:8080/", "http://127.0.0.1:8080"],
  ["http://127.0.0.1:8080/#case=a", "http://127.0.0.1:8080"],
  ["https://hospital.example.org/planner/?code=1&state=2#follow=a", "https://hospital.example.org/planner"],
  ["https://hospital.example.org/a/b/index.html", "https://hospital.example.org/a/b"],
])("a page at %s calls below %s", (url, base) => expect(baseOf(url)).toBe(base));
