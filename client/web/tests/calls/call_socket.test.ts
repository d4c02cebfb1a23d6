// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { create, toBinary } from "@bufbuild/protobuf";
import { anyPack } from "@bufbuild/protobuf/wkt";
import { expect, test, vi } from "vitest";
import { type CallError, Code } from "../../src/calls/call_error";
import { CallSocket } from "../../src/calls/call_socket";
import { FrameKind, encodeFrame } from "../../src/calls/frame";
import { Patience } from "../../src/calls/silence";
import { ErrorInfoSchema } from "../../src/generated/google/rpc/error_details_pb";
import { StatusSchema } from "../../src/generated/google/rpc/status_pb";
import { DeformRequestSchema, DeformService } from "../../src/generated/tissueform/v1/deform_service_pb";
import { FakeClock } from "../testing/fake_clock";
import { FakeSocket } from "../testing/fake_socket";

function open(metadata: Record<string, string> = {}) {
  const socket = new FakeSocket();
  const ends: (CallError | null)[] = [];
  const onMessage = vi.fn();
  const call = new CallSocket(() => socket, DeformService.method.deform, { onMessage, onEnd: (error) => ends.push(error) }, { metadata, deadlineMs: 1500.2 });
  return { socket, call, ends, onMessage };
}

test("a call begins with its method, metadata and deadline, and waits for the socket", () => {
  const { socket, call } = open({ "x-tissueform-session": "abc" });
  call.send(create(DeformRequestSchema));
  expect(socket.sent).toHaveLength(0);
  socket.onopen?.();
  expect(socket.kinds).toEqual([FrameKind.Start, FrameKind.Message]);
  expect(socket.start().method).toBe("/tissueform.v1.DeformService/Deform");
  expect(socket.start().metadata).toEqual({ "x-tissueform-session": "abc" });
  expect(socket.start().deadlineMs).toBe(1501n);
});

test("half-close is a frame without payload", () => {
  const { socket, call } = open();
  socket.onopen?.();
  call.halfClose();
  expect(socket.kinds).toEqual([FrameKind.Start, FrameKind.HalfClose]);
  expect(socket.sent[1].byteLength).toBe(32);
});

test("a good end is no error", () => {
  const { socket, ends } = open();
  socket.onopen?.();
  socket.end(0);
  expect(ends).toEqual([null]);
});

test("an end with ErrorInfo gives code, message and reason", () => {
  const { socket, ends } = open();
  socket.onopen?.();
  const details = [anyPack(ErrorInfoSchema, create(ErrorInfoSchema, { reason: "SESSION_NOT_FOUND", domain: "tissueform" }))];
  socket.end(5, "no session of that name", toBinary(StatusSchema, create(StatusSchema, { code: 5, details })));
  expect(ends[0]).toMatchObject({ code: Code.NotFound, message: "no session of that name", reason: "SESSION_NOT_FOUND", isPassing: false });
});

const BY_PROXIES = [Code.Canceled, Code.Unknown, Code.Internal, Code.Unavailable];

test.each(BY_PROXIES)("the server's status overrides the code that a proxy makes of it (%i)", (code) => {
  const end = (said: Code, reason: string) => {
    const { socket, ends } = open();
    const details = [anyPack(ErrorInfoSchema, create(ErrorInfoSchema, { reason, domain: "tissueform" }))];
    socket.end(code, "Received RST_STREAM with error code 8", toBinary(StatusSchema, create(StatusSchema, { code: said, message: "said", details })));
    return ends[0];
  };
  for (const reason of ["SESSION_MOVED", "WRONG_NODE", "SERVER_DRAINING"]) {
    expect(end(Code.Unavailable, reason)).toMatchObject({ code: Code.Unavailable, reason, isPassing: true, isOfServer: true });
    expect(end(0 as Code, reason)).toMatchObject({ reason, isPassing: true, isOfServer: true });
  }
  expect(end(Code.NotFound, "SESSION_NOT_FOUND")).toMatchObject({ code: Code.NotFound, message: "said", isPassing: false });
});

test.each(BY_PROXIES)("an end without a reason that nobody here asked for passes (%i)", (code) => {
  const { socket, ends } = open();
  socket.end(code, "Received RST_STREAM with error code 8");
  expect(ends[0]).toMatchObject({ isPassing: true, isOfServer: true });
  expect(ends[0]?.code).not.toBe(Code.Canceled);
});

test("details that cannot be read do not hide the error", () => {
  const { socket, ends } = open();
  socket.end(14, "draining", new Uint8Array([255, 255, 255]));
  expect(ends[0]).toMatchObject({ code: Code.Unavailable, message: "draining", reason: "", isPassing: true });
});

test("a socket that closes without an end is a passing error, reported once", () => {
  const { socket, ends } = open();
  socket.onclose?.({ code: 1006, reason: "" });
  socket.onclose?.({ code: 1006, reason: "" });
  expect(ends).toHaveLength(1);
  expect(ends[0]?.isPassing).toBe(true);
});

test("a message that was too large is no passing error", () => {
  const { socket, ends } = open();
  socket.onclose?.({ code: 1009, reason: "" });
  expect(ends[0]).toMatchObject({ code: Code.ResourceExhausted, isPassing: false });
});

test.each<[string, unknown]>([
  ["text", "hello"],
  ["what is no frame", new ArrayBuffer(5)],
  ["a frame that only clients send", encodeFrame(FrameKind.Start, new Uint8Array()).buffer],
  ["a message that is none", encodeFrame(FrameKind.Message, new Uint8Array([0xff, 0xff])).buffer],
])("%s ends the call and closes the socket", (_, data) => {
  const { socket, ends } = open();
  socket.onopen?.();
  socket.onmessage?.({ data });
  expect(ends).toHaveLength(1);
  expect(ends[0]?.code).toBe(Code.DataLoss);
  expect(socket.closedWith).toBe(1000);
});

test("a cancelled call hears and sends nothing more", () => {
  const { socket, call, ends, onMessage } = open();
  socket.onopen?.();
  call.cancel();
  socket.answer({});
  socket.end(0);
  call.send(create(DeformRequestSchema));
  expect(ends).toHaveLength(0);
  expect(onMessage).not.toHaveBeenCalled();
  expect(socket.sent).toHaveLength(1);
});

function timed(patience = new Patience()) {
  const clock = new FakeClock();
  const socket = new FakeSocket();
  const reported: (string | boolean)[] = [];
  const handlers = { onMessage: () => reported.push("message"), onQuiet: (isQuiet: boolean) => reported.push(isQuiet), onEnd: (error: CallError | null) => reported.push(error?.message ?? "end") };
  const call = new CallSocket(() => socket, DeformService.method.deform, handlers, { patience, timer: clock.timer });
  return { clock, socket, reported, call };
}

test("heartbeats keep a call that says nothing else", () => {
  const { clock, socket, reported } = timed();
  socket.onopen?.();
  expect(socket.start().wantsHeartbeat).toBe(true);
  for (let i = 0; i < 100; ++i) {
    socket.heartbeat();
    clock.pass(3);
  }
  expect(reported).toEqual([]);
});

test("a gateway that sends no heartbeat is not taken for dead", () => {
  const { clock, socket, reported } = timed();
  socket.onopen?.();
  clock.pass(1000);
  expect(reported).toEqual([]);
});

test("a call whose heartbeats stop ends, as one that passes", () => {
  const { clock, socket, reported } = timed();
  socket.onopen?.();
  socket.heartbeat();
  clock.pass(8);
  expect(reported).toEqual([true, "the server has not answered for 8 s"]);
  expect(socket.closedWith).toBe(1000);
  clock.pass(100);
  expect(reported).toHaveLength(2);
});

test("a socket that does not open ends within 8 s", () => {
  const { clock, reported } = timed();
  clock.pass(8);
  expect(reported[reported.length - 1]).toBe("the connection to the gateway does not open");
});

test("on a line that is slower than the first patience calls get the time that they need, and less again when they last", () => {
  const patience = new Patience();
  const { clock, socket, reported } = timed(patience);
  socket.onopen?.();
  socket.heartbeat();
  clock.pass(8);
  expect(reported).toContain("the server has not answered for 8 s");
  const next = timed(patience);
  next.socket.onopen?.();
  next.socket.heartbeat();
  next.clock.pass(12);
  next.socket.heartbeat();
  expect(next.reported).toEqual([true, false]);
  expect(patience.seconds).toBe(36);
  for (let i = 0; i < 40; ++i) {
    next.clock.pass(1);
    next.socket.heartbeat();
  }
  expect(patience.seconds).toBe(18);
});
