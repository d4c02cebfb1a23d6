// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { expect, test } from "vitest";
import { CallError, Code } from "../../src/calls/call_error";
import { BLOCKED } from "../../src/calls/call_socket";
import { Interruption } from "../../src/live/interruption";

const GONE = new CallError(Code.Unavailable, "the server is gone");
const MOVED = new CallError(Code.Unavailable, "the session is elsewhere", "SESSION_MOVED");

test("a single server that is away is reported by its error", () => {
  expect(new Interruption({ isCluster: false }).connection(GONE)).toEqual({ kind: "broken", text: "The server is gone." });
});

test("in a cluster the session moves, as a short word", () => {
  expect(new Interruption({ isCluster: true }).connection(GONE)).toEqual({ kind: "moving" });
  expect(new Interruption({ isCluster: false }).connection(MOVED)).toEqual({ kind: "moving" });
});

test("an error that another server cannot fix is reported at once", () => {
  const blocked = new CallError(Code.Unavailable, "a proxy blocks WebSockets", BLOCKED);
  expect(new Interruption({ isCluster: true }).connection(blocked)).toEqual({ kind: "broken", text: "A proxy blocks WebSockets." });
});

test("an interruption longer than any move is reported by its error, until it ends", () => {
  let now = 0;
  const interruption = new Interruption({ isCluster: true }, () => now);
  interruption.connection(GONE);
  now = 29_000;
  expect(interruption.connection(GONE).kind).toBe("moving");
  now = 31_000;
  expect(interruption.connection(MOVED).kind).toBe("broken");
  interruption.end();
  expect(interruption.connection(GONE).kind).toBe("moving");
});
