// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { create, toBinary } from "@bufbuild/protobuf";
import { anyPack } from "@bufbuild/protobuf/wkt";
import { describe, expect, test } from "vitest";
import { Bearer } from "../../src/calls/bearer";
import { CallError, Code } from "../../src/calls/call_error";
import { CallSocket } from "../../src/calls/call_socket";
import type { Gateway } from "../../src/calls/gateway";
import { ErrorInfoSchema } from "../../src/generated/google/rpc/error_details_pb";
import { StatusSchema } from "../../src/generated/google/rpc/status_pb";
import { DeformConfigurationSchema } from "../../src/generated/tissueform/v1/deform_service_pb";
import { DragSession, type DisplayedFrame } from "../../src/live/drag_session";
import { toMessages } from "../../src/live/pose_messages";
import { Patience } from "../../src/calls/silence";
import { FakeClock } from "../testing/fake_clock";
import { FakeSocket } from "../testing/fake_socket";

const POSES = toMessages(["mandible"], [{ rotationVector: [0, 0, 0], pivotMm: [0, 0, 0], translationMm: [1, 2, 3], scale: 1 }]);

/** A drag whose sockets, time and patience are the test's. */
function drag() {
  const sockets: FakeSocket[] = [];
  const timers: { action: () => void; delayMs: number }[] = [];
  const events: string[] = [];
  const pictures: { picture: DisplayedFrame; used: () => void }[] = [];
  const errors: CallError[] = [];
  let now = 0;
  const bearer = new Bearer();
  const gateway = {
    bearer,
    open: (method: any, handlers: any, options: any) => {
      const socket = new FakeSocket();
      sockets.push(socket);
      const call = new CallSocket(() => socket, method, handlers, options);
      socket.onopen?.();
      return call;
    },
  } as unknown as Pick<Gateway, "open" | "bearer">;
  const session = new DragSession(
    gateway,
    create(DeformConfigurationSchema, { session: "sessions/abc" }),
    {
      onStarted: () => events.push("started"),
      onPicture: (picture, used) => pictures.push({ picture, used }),
      onNotice: ({ notice }) => events.push(notice.case ?? ""),
      onWaiting: (isWaiting) => events.push(isWaiting ? "waiting" : "answered"),
      onBroken: () => events.push("broken"),
      onEnd: (error) => errors.push(error),
    },
    (action, delayMs) => {
      timers.push({ action, delayMs });
      return () => timers.splice(0);
    },
    () => now,
  );
  const last = () => sockets[sockets.length - 1];
  return { session, sockets, timers, events, pictures, errors, last, bearer, sleep: (ms: number) => (now += ms) };
}

function sessionMoved(): Uint8Array {
  const info = anyPack(ErrorInfoSchema, create(ErrorInfoSchema, { reason: "SESSION_MOVED" }));
  return toBinary(StatusSchema, create(StatusSchema, { code: Code.Unavailable, details: [info] }));
}

const STARTED = { message: { case: "started" as const, value: {} } };
const frame = (sequence: bigint, refinement = 0) => ({
  message: { case: "frame" as const, value: { sequence, refinement, positions: new Uint8Array(12) } },
});

describe("a drag", () => {
  test("goes on with a new token, which it sends once", () => {
    const { last, bearer } = drag();
    bearer.token = "first";
    expect(last().deformRequests()).toHaveLength(1);
    last().answer(STARTED);
    bearer.token = "second";
    bearer.token = "second";
    bearer.token = "";
    const sent = last().deformRequests().flatMap(({ message }) => (message.case === "token" ? [message.value] : []));
    expect(sent).toEqual(["first", "second"]);
  });

  test("that is over hears of no more tokens", () => {
    const { session, last, bearer } = drag();
    last().answer(STARTED);
    session.close();
    bearer.token = "late";
    expect(last().deformRequests().some(({ message }) => message.case === "token")).toBe(false);
  });

  test("begins with its configuration and sends the newest poses once the server listens", () => {
    const { session, last, events } = drag();
    session.sendPoses(POSES, false);
    session.sendPoses(POSES, false);
    expect(last().deformRequests().map(({ message }) => message.case)).toEqual(["configuration"]);
    expect(last().start().metadata).toEqual({ "x-tissueform-session": "abc" });
    last().answer(STARTED);
    const [, pose, ...others] = last().deformRequests();
    expect(others).toHaveLength(0);
    expect(pose.message).toMatchObject({ case: "pose", value: { sequence: 2n, commit: false } });
    expect(events).toEqual(["started"]);
  });

  test("acknowledges a picture when it was used, not before", () => {
    const { session, last, pictures, sleep } = drag();
    last().answer(STARTED);
    session.sendPoses(POSES, false);
    sleep(7);
    last().answer(frame(1n, 2));
    const acks = () => last().deformRequests().filter(({ message }) => message.case === "ack");
    expect(acks()).toHaveLength(0);
    expect(pictures[0].picture.roundTripMs).toBe(7);
    expect(pictures[0].picture.positions).toHaveLength(3);
    expect(pictures[0].picture.uncertainty).toBeNull();
    pictures[0].used();
    expect(acks()[0].message).toMatchObject({ value: { sequence: 1n, refinement: 2 } });
  });

  test("goes on over another connection with the newest poses", () => {
    const { session, sockets, timers, last, events } = drag();
    last().answer(STARTED);
    session.sendPoses(POSES, false);
    last().onclose?.({ code: 1006, reason: "" });
    expect(events).toEqual(["started", "broken"]);
    session.sendPoses(POSES, false);
    timers[0].action();
    expect(sockets).toHaveLength(2);
    last().answer(STARTED);
    expect(last().deformRequests()[1].message).toMatchObject({ case: "pose", value: { sequence: 2n } });
  });

  test("waits longer from try to try, and starts over after a success that lasted", () => {
    const { timers, last, sleep } = drag();
    for (let i = 0; i < 8; ++i) {
      last().onclose?.({ code: 1006, reason: "" });
      timers[i].action();
    }
    const delays = timers.map(({ delayMs }) => delayMs);
    expect(delays[1]).toBeGreaterThan(delays[0] * 1.5);
    expect(delays[7]).toBeGreaterThan(3900);
    expect(Math.max(...delays)).toBeLessThanOrEqual(5000);
    last().answer(STARTED);
    last().onclose?.({ code: 1006, reason: "" });
    expect(timers[8].delayMs).toBeGreaterThan(3900);
    timers[8].action();
    last().answer(STARTED);
    sleep(2000);
    last().onclose?.({ code: 1006, reason: "" });
    expect(timers[9].delayMs).toBeLessThanOrEqual(250);
  });

  test.each([Code.Unavailable, Code.Canceled, Code.Unknown, Code.Internal])(
    "whose streams begin and end at once does not ask without pause, whatever code comes (%i)",
    (code) => {
      const { timers, last, errors, sleep } = drag();
      let [now, tries] = [0, 0];
      for (; now < 40_000 && tries < 10_000; ++tries) {
        last().answer(STARTED);
        last().end(code, "elsewhere", sessionMoved());
        expect(errors).toEqual([]);
        now += timers[tries].delayMs + 8;
        sleep(timers[tries].delayMs + 8);
        timers[tries].action();
      }
      expect(tries).toBeLessThan(5 * 40);
    },
  );

  test("continues at once when its session moves, with the newest poses and the pending commit", () => {
    const { session, sockets, timers, last, events } = drag();
    last().answer(STARTED);
    session.sendPoses(POSES, true);
    last().end(Code.Unavailable, "elsewhere", sessionMoved());
    expect(timers[0].delayMs).toBe(0);
    session.sendPoses(POSES, false);
    timers[0].action();
    expect(sockets).toHaveLength(2);
    last().answer(STARTED);
    expect(last().deformRequests()[1].message).toMatchObject({ case: "pose", value: { sequence: 2n, commit: true } });
    expect(events).toEqual(["started", "broken", "started"]);
  });

  test("repeats a commit until the server says that it keeps the poses", () => {
    const { session, timers, last } = drag();
    last().answer(STARTED);
    session.sendPoses(POSES, true);
    expect(session.isCommitted).toBe(false);
    last().end(14, "gone");
    timers[0].action();
    last().answer(STARTED);
    expect(last().deformRequests()[1].message).toMatchObject({ case: "pose", value: { commit: true } });
    last().answer({ message: { case: "notice", value: { notice: { case: "committed", value: { sequence: 1n } } } } });
    expect(session.isCommitted).toBe(true);
    last().onclose?.({ code: 1006, reason: "" });
    timers[1].action();
    last().answer(STARTED);
    expect(last().deformRequests()[1].message).toMatchObject({ value: { commit: false } });
  });

  test("reports notices in their order", () => {
    const { last, events } = drag();
    const notice = (name: "evicted" | "restored" | "draining") => ({ message: { case: "notice" as const, value: { notice: { case: name, value: {} } } } });
    last().answer(STARTED);
    last().answer(notice("evicted"));
    last().answer(notice("restored"));
    last().answer(notice("draining"));
    expect(events).toEqual(["started", "evicted", "restored", "draining"]);
  });

  test("ends where trying again does not help", () => {
    const { last, timers, errors } = drag();
    last().end(Code.NotFound, "no such session");
    expect(errors[0]).toMatchObject({ code: Code.NotFound });
    expect(timers).toHaveLength(0);
  });

  test("that was closed reports nothing more and does not reconnect", () => {
    const { session, last, timers, events } = drag();
    session.close();
    last().onclose?.({ code: 1006, reason: "" });
    expect(events).toEqual([]);
    expect(timers).toHaveLength(0);
  });

  test("ends with a readable error when a frame is no positions", () => {
    const { last, errors } = drag();
    last().answer(STARTED);
    last().answer({ message: { case: "frame", value: { sequence: 1n, positions: new Uint8Array(5) } } });
    expect(errors[0].message).toContain("no whole numbers");
  });
});

/** A live drag on a clock of the test's, over gateways that send heartbeats as long as `isMute` is false. */
function timedDrag() {
  const clock = new FakeClock();
  const sockets: FakeSocket[] = [];
  const events: string[] = [];
  const used: (() => void)[] = [];
  const patience = new Patience();
  const open = (method: any, handlers: any, options: any) => {
    const socket = new FakeSocket();
    sockets.push(socket);
    const call = new CallSocket(() => socket, method, handlers, { ...options, patience, timer: clock.timer });
    socket.onopen?.();
    return call;
  };
  const gateway = { bearer: new Bearer(), open } as unknown as Pick<Gateway, "open" | "bearer">;
  const listener = {
    onStarted: () => events.push("started"),
    onPicture: (_: DisplayedFrame, wasUsed: () => void) => used.push(wasUsed),
    onNotice: () => {},
    onWaiting: (isWaiting: boolean) => events.push(isWaiting ? "waiting" : "answered"),
    onBroken: (error: CallError) => events.push(`broken: ${error.message}`),
    onEnd: () => events.push("end"),
  };
  const session = new DragSession(gateway, create(DeformConfigurationSchema, { session: "sessions/abc", maxUnacked: 3 }), listener, clock.timer, () => clock.nowMs);
  const last = () => sockets[sockets.length - 1];
  /** Seconds in which the gateway lives and the server says nothing. */
  const beat = (seconds: number) => {
    for (let i = 0; i < seconds; ++i) {
      clock.pass(1);
      last().heartbeat();
    }
  };
  last().heartbeat();
  last().answer(STARTED);
  return { session, clock, sockets, events, used, last, beat };
}

const committed = (sequence: bigint) => ({ message: { case: "notice" as const, value: { notice: { case: "committed" as const, value: { sequence } } } } });
const noticed = (name: "evicted" | "restored") => ({ message: { case: "notice" as const, value: { notice: { case: name, value: {} } } } });

describe("over a connection that is open and dead", () => {
  test("a pose without an answer is waited for after 2 s, and sent over another connection after 8 s", () => {
    const { session, clock, sockets, events, last } = timedDrag();
    session.sendPoses(POSES, true);
    clock.pass(1.9);
    expect(events).toEqual(["started"]);
    clock.pass(0.1);
    expect(events).toEqual(["started", "waiting"]);
    clock.pass(5.9);
    expect(sockets).toHaveLength(1);
    clock.pass(0.5);
    expect(events.slice(2)).toEqual(["broken: the server has not answered for 8 s"]);
    expect(sockets).toHaveLength(2);
    expect(sockets[0].closedWith).toBe(1000);
    last().answer(STARTED);
    expect(last().deformRequests()[1].message).toMatchObject({ case: "pose", value: { sequence: 1n, commit: true } });
    last().answer(frame(1n));
    last().answer(committed(1n));
    expect(events.slice(3)).toEqual(["started"]);
    expect(session.isCommitted).toBe(true);
    session.sendPoses(POSES, true);
    clock.pass(8.5);
    expect(events.slice(4)).toEqual(["waiting", "broken: the server has not answered for 8 s"]);
  });

  test.each([false, true])("so is one whose gateway lives (commit: %s)", (commit) => {
    const { session, sockets, events, beat } = timedDrag();
    session.sendPoses(POSES, commit);
    beat(9);
    expect(events).toEqual(["started", "waiting", "broken: the server has not answered for 8 s"]);
    expect(sockets).toHaveLength(2);
  });

  test("so is a commit whose frame has come", () => {
    const { session, events, last, beat, used } = timedDrag();
    session.sendPoses(POSES, true);
    last().answer(frame(1n));
    used[0]();
    beat(3);
    expect(events).toEqual(["started", "waiting"]);
    last().answer(committed(1n));
    expect(events).toEqual(["started", "waiting", "answered"]);
    beat(60);
    expect(events).toHaveLength(3);
  });

  test("nothing is waited for while answers come, nor once all have come", () => {
    const { session, events, last, beat, used } = timedDrag();
    for (let i = 1; i <= 20; ++i) {
      session.sendPoses(POSES, false);
      beat(1);
      last().answer(frame(BigInt(i)));
      used[i - 1]();
    }
    beat(300);
    expect(events).toEqual(["started"]);
  });

  test("the hand rests: the gateway's silence is reported after 5 s, and ends the connection after 8 s", () => {
    const { clock, sockets, events } = timedDrag();
    clock.pass(4.5);
    expect(events).toEqual(["started"]);
    clock.pass(1);
    expect(events).toEqual(["started", "waiting"]);
    clock.pass(3);
    expect(sockets).toHaveLength(2);
  });

  test("a page that shows no pictures is not owed any", () => {
    const { session, events, last, beat, used } = timedDrag();
    for (let i = 1; i <= 3; ++i) {
      session.sendPoses(POSES, false);
      last().answer(frame(BigInt(i)));
    }
    session.sendPoses(POSES, false);
    beat(60);
    expect(events).toEqual(["started"]);
    used[2]();
    beat(2);
    expect(events).toEqual(["started", "waiting"]);
  });

  test("a session that comes back to memory is waited for as long as the gateway lives", () => {
    const { session, events, last, beat } = timedDrag();
    session.sendPoses(POSES, true);
    last().answer(noticed("evicted"));
    beat(120);
    expect(events).toEqual(["started"]);
    last().answer(noticed("restored"));
    beat(2);
    expect(events).toEqual(["started", "waiting"]);
  });

  test("an answer that takes longer is given twice the time again, and comes", () => {
    const { session, clock, sockets, events, last } = timedDrag();
    session.sendPoses(POSES, false);
    const seconds: number[] = [];
    for (let from = clock.nowMs; sockets.length < 4; from = clock.nowMs) {
      const count = sockets.length;
      while (sockets.length === count) clock.pass(0.25);
      seconds.push(Math.round((clock.nowMs - from) / 1000));
      last().answer(STARTED);
    }
    expect(seconds).toEqual([8, 16, 32]);
    clock.pass(30);
    last().answer(frame(1n));
    session.sendPoses(POSES, false);
    clock.pass(40);
    expect(sockets).toHaveLength(4);
    expect(events.filter((word) => word === "end")).toEqual([]);
  });
});
