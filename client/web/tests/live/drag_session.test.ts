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
import { DragSession, type Picture } from "../../src/live/drag_session";
import { toMessages } from "../../src/live/pose_messages";
import { FakeSocket } from "../testing/fake_socket";

const POSES = toMessages(["mandible"], [{ rotationVector: [0, 0, 0], pivotMm: [0, 0, 0], translationMm: [1, 2, 3], scale: 1 }]);

/** A drag whose sockets, time and patience are the test's. */
function drag() {
  const sockets: FakeSocket[] = [];
  const timers: { action: () => void; delayMs: number }[] = [];
  const told: string[] = [];
  const pictures: { picture: Picture; used: () => void }[] = [];
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
      onStarted: () => told.push("started"),
      onPicture: (picture, used) => pictures.push({ picture, used }),
      onNotice: ({ notice }) => told.push(notice.case ?? ""),
      onBroken: () => told.push("broken"),
      onEnd: (error) => errors.push(error),
    },
    (action, delayMs) => {
      timers.push({ action, delayMs });
      return () => timers.splice(0);
    },
    () => now,
  );
  const last = () => sockets[sockets.length - 1];
  return { session, sockets, timers, told, pictures, errors, last, bearer, sleep: (ms: number) => (now += ms) };
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
  test("goes on with a new token, which it is told once", () => {
    const { last, bearer } = drag();
    bearer.token = "first";
    expect(last().deformRequests()).toHaveLength(1);
    last().answer(STARTED);
    bearer.token = "second";
    bearer.token = "second";
    bearer.token = "";
    const told = last().deformRequests().flatMap(({ message }) => (message.case === "token" ? [message.value] : []));
    expect(told).toEqual(["first", "second"]);
  });

  test("that is over hears of no more tokens", () => {
    const { session, last, bearer } = drag();
    last().answer(STARTED);
    session.close();
    bearer.token = "late";
    expect(last().deformRequests().some(({ message }) => message.case === "token")).toBe(false);
  });

  test("begins with its configuration and sends the newest poses once the server listens", () => {
    const { session, last, told } = drag();
    session.sendPoses(POSES, false);
    session.sendPoses(POSES, false);
    expect(last().deformRequests().map(({ message }) => message.case)).toEqual(["configuration"]);
    expect(last().start().metadata).toEqual({ "x-tissueform-session": "abc" });
    last().answer(STARTED);
    const [, pose, ...others] = last().deformRequests();
    expect(others).toHaveLength(0);
    expect(pose.message).toMatchObject({ case: "pose", value: { sequence: 2n, commit: false } });
    expect(told).toEqual(["started"]);
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
    const { session, sockets, timers, last, told } = drag();
    last().answer(STARTED);
    session.sendPoses(POSES, false);
    last().onclose?.({ code: 1006, reason: "" });
    expect(told).toEqual(["started", "broken"]);
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

  test("whose session moves goes on at once, with the newest poses and what was not kept", () => {
    const { session, sockets, timers, last, told } = drag();
    last().answer(STARTED);
    session.sendPoses(POSES, true);
    last().end(Code.Unavailable, "elsewhere", sessionMoved());
    expect(timers[0].delayMs).toBe(0);
    session.sendPoses(POSES, false);
    timers[0].action();
    expect(sockets).toHaveLength(2);
    last().answer(STARTED);
    expect(last().deformRequests()[1].message).toMatchObject({ case: "pose", value: { sequence: 2n, commit: true } });
    expect(told).toEqual(["started", "broken", "started"]);
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

  test("tells notices in their order", () => {
    const { last, told } = drag();
    const notice = (name: "evicted" | "restored" | "draining") => ({ message: { case: "notice" as const, value: { notice: { case: name, value: {} } } } });
    last().answer(STARTED);
    last().answer(notice("evicted"));
    last().answer(notice("restored"));
    last().answer(notice("draining"));
    expect(told).toEqual(["started", "evicted", "restored", "draining"]);
  });

  test("ends where trying again does not help", () => {
    const { last, timers, errors } = drag();
    last().end(Code.NotFound, "no such session");
    expect(errors[0]).toMatchObject({ code: Code.NotFound });
    expect(timers).toHaveLength(0);
  });

  test("that was closed tells nothing more and tries nothing more", () => {
    const { session, last, timers, told } = drag();
    session.close();
    last().onclose?.({ code: 1006, reason: "" });
    expect(told).toEqual([]);
    expect(timers).toHaveLength(0);
  });

  test("ends with a readable error when a frame is no positions", () => {
    const { last, errors } = drag();
    last().answer(STARTED);
    last().answer({ message: { case: "frame", value: { sequence: 1n, positions: new Uint8Array(5) } } });
    expect(errors[0].message).toContain("no whole numbers");
  });
});
