// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { create, toBinary } from "@bufbuild/protobuf";
import { expect, test, vi } from "vitest";
import { Bearer } from "../../src/calls/bearer";
import { CallError, Code } from "../../src/calls/call_error";
import { CallSocket } from "../../src/calls/call_socket";
import { FrameKind, encodeFrame } from "../../src/calls/frame";
import { WatchOrigin, WatchResponseSchema } from "../../src/generated/tissueform/v1/deform_service_pb";
import { PositionEncoding } from "../../src/generated/tissueform/v1/geometry_pb";
import { FollowSession, type FollowedPicture } from "../../src/live/follow_session";
import { FakeClock } from "../testing/fake_clock";
import { FakeSocket } from "../testing/fake_socket";
import type { MessageInitShape } from "@bufbuild/protobuf";

const settle = () => new Promise((done) => setImmediate(done));

/** On a clock, or on timers that the test lets run out. */
function follow(clock?: FakeClock) {
  const sockets: FakeSocket[] = [];
  const events: string[] = [];
  const pictures: { picture: FollowedPicture; used: () => void }[] = [];
  const timers: (() => void)[] = [];
  const stopped: (() => void)[] = [];
  const acknowledgeWatch = vi.fn((): Promise<object> => Promise.resolve({}));
  const bearer = new Bearer();
  const gateway = {
    deform: { acknowledgeWatch },
    bearer,
    open: (method: any, handlers: any, options: any) => {
      const socket = new FakeSocket();
      sockets.push(socket);
      const call = new CallSocket(() => socket, method, handlers, { ...options, timer: clock?.timer });
      socket.onopen?.();
      return call;
    },
  };
  new FollowSession(
    gateway as never,
    "sessions/abc",
    {
      onStarted: () => events.push("started"),
      onPicture: (picture, used) => pictures.push({ picture, used }),
      onNotice: () => events.push("notice"),
      onWaiting: (isWaiting) => events.push(isWaiting ? "waiting" : "goes on"),
      onBroken: () => events.push("broken"),
      onEnd: (error) => events.push(error.message),
    },
    clock?.timer ?? ((action) => (timers.push(action), () => stopped.push(action))),
  );
  const answer = (message: MessageInitShape<typeof WatchResponseSchema>["message"]) => {
    const payload = toBinary(WatchResponseSchema, create(WatchResponseSchema, { message }));
    sockets[sockets.length - 1].onmessage?.({ data: encodeFrame(FrameKind.Message, payload).buffer });
  };
  return { sockets, events, pictures, timers, stopped, acknowledgeWatch, bearer, answer };
}

const started = (vertices: number[], encoding = PositionEncoding.FLOAT32) => ({
  case: "started" as const,
  value: { watch: "watches/1", form: { vertexCount: BigInt(vertices.length), vertices, encoding } },
});
const frame = (number: bigint, floats: number[], origin = WatchOrigin.DRAG) => ({
  case: "frame" as const,
  value: { number, origin, frame: { positions: new Uint8Array(Float32Array.from(floats).buffer) } },
});

test("a watch asks once, and acknowledges what was used", () => {
  const { sockets, answer, pictures, acknowledgeWatch } = follow();
  expect(sockets[0].kinds).toEqual([FrameKind.Start, FrameKind.Message, FrameKind.HalfClose]);
  answer(started([4]));
  answer(frame(7n, [1, 2, 3]));
  expect(Array.from(pictures[0].picture.positions)).toEqual([1, 2, 3]);
  expect(pictures[0].picture.vertices).toEqual([4]);
  expect(acknowledgeWatch).not.toHaveBeenCalled();
  pictures[0].used();
  expect(acknowledgeWatch.mock.calls[0]).toMatchObject([{ watch: "watches/1", number: 7n }, {}]);
});

test("an acknowledgement that was lost is repeated, for the server waits for it", async () => {
  const { answer, pictures, acknowledgeWatch, timers } = follow();
  acknowledgeWatch.mockImplementationOnce(() => Promise.reject(new CallError(Code.DeadlineExceeded, "nothing came")));
  answer(started([4]));
  answer(frame(7n, [1, 2, 3]));
  pictures[0].used();
  await settle();
  timers[timers.length - 1]();
  expect(acknowledgeWatch).toHaveBeenCalledTimes(2);
  expect(acknowledgeWatch.mock.calls[1]).toMatchObject([{ watch: "watches/1", number: 7n }, {}]);
});

test("one that a newer one stands for is not repeated", async () => {
  const { answer, pictures, acknowledgeWatch, timers } = follow();
  acknowledgeWatch.mockImplementationOnce(() => Promise.reject(new CallError(Code.DeadlineExceeded, "nothing came")));
  answer(started([4]));
  answer(frame(7n, [1, 2, 3]));
  answer(frame(8n, [1, 2, 3]));
  pictures.forEach(({ used }) => used());
  await settle();
  expect(timers).toHaveLength(0);
  expect(acknowledgeWatch).toHaveBeenCalledTimes(2);
});

test("a silent gateway is reported, and its watch is opened again", () => {
  const clock = new FakeClock();
  const { events, answer, sockets } = follow(clock);
  sockets[0].heartbeat();
  answer(started([4]));
  clock.pass(5.5);
  expect(events).toEqual(["started", "waiting"]);
  sockets[0].heartbeat();
  expect(events).toEqual(["started", "waiting", "goes on"]);
  clock.pass(9);
  expect(events.slice(3)).toEqual(["waiting", "broken"]);
  expect(sockets).toHaveLength(2);
});

test("a new token is sent with a repeated acknowledgment", () => {
  const { answer, pictures, acknowledgeWatch, bearer } = follow();
  answer(started([4]));
  bearer.token = "before any picture";
  expect(acknowledgeWatch).not.toHaveBeenCalled();
  answer(frame(7n, [1, 2, 3]));
  pictures[0].used();
  bearer.token = "renewed";
  expect(acknowledgeWatch).toHaveBeenCalledTimes(2);
  expect(acknowledgeWatch.mock.calls[1]).toMatchObject([{ watch: "watches/1", number: 7n }, {}]);
});

test("another form holds for the frames after it", () => {
  const { answer, pictures } = follow();
  answer(started([4]));
  answer({ case: "form", value: { vertexCount: 2n, vertices: [1, 2] } });
  answer(frame(8n, [1, 2, 3, 4, 5, 6]));
  expect(pictures[0].picture.vertices).toEqual([1, 2]);
});

test("packed frames are refused in words", () => {
  const { answer, events } = follow();
  answer(started([4], PositionEncoding.INT16_ZSTD));
  answer(frame(1n, [1, 2, 3]));
  expect(events[events.length - 1]).toContain("cannot unpack");
});

test("a watch that breaks off begins again, one whose session is gone ends", () => {
  const { sockets, events, timers, answer } = follow();
  answer(started([4]));
  sockets[0].onclose?.({ code: 1006, reason: "" });
  timers[0]();
  expect(sockets).toHaveLength(2);
  sockets[1].end(5, "no such session");
  expect(events).toEqual(["started", "broken", "no such session"]);
  expect(timers).toHaveLength(1);
});

test("after a break the face stays as it was dragged until the drag is back", () => {
  const { sockets, timers, stopped, answer, pictures } = follow();
  answer(started([4]));
  answer(frame(1n, [0, 0, 0], WatchOrigin.REST));
  expect(pictures).toHaveLength(1);
  answer(frame(2n, [1, 1, 1]));
  sockets[0].onclose?.({ code: 1006, reason: "" });
  timers[0]();
  answer(started([4]));
  answer(frame(1n, [0, 0, 0], WatchOrigin.COMMITTED));
  expect(pictures).toHaveLength(2);
  answer(frame(2n, [2, 2, 2]));
  expect(pictures).toHaveLength(3);
  expect(stopped).toContain(timers[1]);
  answer(frame(3n, [0, 0, 0], WatchOrigin.COMMITTED));
  expect(pictures).toHaveLength(4);
});

test("where the drag does not come back what was committed is shown", () => {
  const { sockets, timers, stopped, answer, pictures, acknowledgeWatch } = follow();
  answer(started([4]));
  answer(frame(1n, [1, 1, 1]));
  for (const turn of [0, 2]) {
    sockets[sockets.length - 1].onclose?.({ code: 1006, reason: "" });
    timers[turn]();
    answer(started([4]));
    answer(frame(5n, [0, 0, 0], WatchOrigin.COMMITTED));
  }
  expect(stopped).toContain(timers[1]);
  expect(pictures).toHaveLength(1);
  timers[3]();
  expect(pictures).toHaveLength(2);
  expect(Array.from(pictures[1].picture.positions)).toEqual([0, 0, 0]);
  pictures[1].used();
  expect(acknowledgeWatch.mock.calls[0]).toMatchObject([{ number: 5n }, {}]);
});
