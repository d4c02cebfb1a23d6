// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { expect, test } from "vitest";
import { Backoff } from "../../src/calls/backoff";
import { CallError, Code } from "../../src/calls/call_error";
import { SessionRoutes, sessionMetadata } from "../../src/calls/session_routes";

const moved = (node = "") => new CallError(Code.Unavailable, "moved", "SESSION_MOVED", node);
const WRONG_NODE = new CallError(Code.Unavailable, "another", "WRONG_NODE");
const GONE = new CallError(Code.Unavailable, "gone");
const FULL = new CallError(Code.ResourceExhausted, "full", "MEMORY_BUDGET_FULL", "b");

test("where there is one server no call names it", () => {
  const routes = new SessionRoutes();
  routes.learn("s", "");
  expect(routes.metadata("s")).toEqual({});
  expect(routes.isCluster).toBe(false);
});

test("a session's calls name the server that has answered for it, others do not", () => {
  const routes = new SessionRoutes();
  routes.learn("s", "a");
  routes.learn("", "c");
  expect(routes.metadata("s")).toEqual({ "x-tissueform-node": "a" });
  expect(routes.metadata("other")).toEqual({});
  expect(routes.metadata("")).toEqual({});
  expect(routes.isCluster).toBe(true);
});

test.each([
  ["a session that has moved", moved("b")],
  ["a server that has no room", FULL],
])("%s is asked for where the error says", (_, error) => {
  const routes = new SessionRoutes();
  routes.learn("s", "a");
  routes.failed("s", "a", error);
  expect(routes.nodeOf("s")).toBe("b");
});

test.each([
  ["moved to nobody knows where", moved()],
  ["of another node", WRONG_NODE],
  ["gone", GONE],
  ["killed, as proxies show it", new CallError(Code.Unknown, "broken")],
])("a server that is %s is named no longer", (_, error) => {
  const routes = new SessionRoutes();
  routes.learn("s", "a");
  routes.failed("s", "a", error);
  expect(routes.metadata("s")).toEqual({});
});

test("servers that name a holder which the proxy never reaches end in one error, and do not while it may have died", () => {
  let now = 0;
  const routes = new SessionRoutes(() => now);
  const backoff = new Backoff(() => 0, () => now);
  const turn = (session = "s") => {
    now += backoff.next(routes.failed(session, "", moved("b")));
    const error = routes.failed(session, "b", WRONG_NODE);
    now += backoff.next(error);
    return error;
  };
  const first = Array.from({ length: 40 }, () => turn());
  expect(first.every((error) => error.isPassing)).toBe(true);
  expect(now).toBeGreaterThan(20_000);
  const last = turn();
  expect(last.isPassing).toBe(false);
  expect(last.message).toMatch("the proxy before the servers");
  expect(turn().isPassing).toBe(true);
  for (let i = 0; i < 100; ++i) {
    now += 6000;
    expect(turn("found in between").isPassing).toBe(true);
  }
});

test("an error that is the call's own says nothing of the server", () => {
  const routes = new SessionRoutes();
  routes.learn("s", "a");
  for (const code of [Code.NotFound, Code.InvalidArgument, Code.Canceled, Code.PermissionDenied]) routes.failed("s", "a", new CallError(code, "no"));
  routes.failed("s", "a", new CallError(Code.Internal, "no", "INTERNAL_ERROR"));
  expect(routes.nodeOf("s")).toBe("a");
});

test("a call that fails late takes nothing of what was learned since", () => {
  const routes = new SessionRoutes();
  routes.learn("s", "a");
  routes.learn("s", "b");
  routes.failed("s", "a", GONE);
  expect(routes.nodeOf("s")).toBe("b");
});

test("a name that is none is not sent back", () => {
  const routes = new SessionRoutes();
  for (const name of ["a b", "a\r\nx: y", "é", "n".repeat(65)]) routes.learn("s", name);
  expect(routes.metadata("s")).toEqual({});
});

test("of 20,000 sessions those that were heard of last are known", () => {
  const routes = new SessionRoutes();
  for (let i = 0; i < 10_000; ++i) routes.learn(`s${i}`, "a");
  routes.learn("s0", "b");
  for (let i = 10_000; i < 19_999; ++i) routes.learn(`s${i}`, "a");
  expect(routes.nodeOf("s0")).toBe("b");
  expect(routes.nodeOf("s1")).toBe("");
  expect(routes.nodeOf("s19998")).toBe("a");
  routes.learn("s20000", "a");
  expect(routes.nodeOf("s0")).toBe("");
});

test("sessions and meshes are named by their ids", () => {
  expect(sessionMetadata("sessions/a")).toEqual({ "x-tissueform-session": "a" });
  expect(sessionMetadata("meshes/b")).toEqual({ "x-tissueform-session": "b" });
});

test("where an error names the server there is no wait, up to four times on end", () => {
  const backoff = new Backoff(() => 0);
  expect([1, 2, 3, 4].map(() => backoff.next(moved("b")))).toEqual([0, 0, 0, 0]);
  expect(backoff.next(moved("b"))).toBe(250);
  expect(backoff.next(moved("b"))).toBe(0);
});

test("the first try after a move to nobody knows where does not wait, the next ones do", () => {
  const backoff = new Backoff(() => 0);
  expect([backoff.next(moved()), backoff.next(moved()), backoff.next(moved())]).toEqual([0, 250, 500]);
});

test("after a success that lasted, and only then, tries begin anew", () => {
  let now = 0;
  const backoff = new Backoff(() => 0, () => now);
  const failure = (lastedMs: number) => {
    backoff.succeeded();
    backoff.succeeded();
    now += lastedMs;
    return backoff.next(moved());
  };
  expect([failure(0), failure(100), failure(1900), failure(2000), failure(0)]).toEqual([0, 250, 500, 0, 250]);
});

test("servers of which one names the other, and that knows nobody, are not asked without pause", () => {
  const backoff = new Backoff(() => 0);
  expect([1, 2, 3, 4].flatMap(() => [backoff.next(moved("b")), backoff.next(moved())])).toEqual([0, 0, 0, 250, 0, 500, 0, 800]);
});

test("a session that nobody may take yet is tried again within a second for as long as that lasts", () => {
  const backoff = new Backoff(() => 0);
  const delays = Array.from({ length: 20 }, () => backoff.next(WRONG_NODE));
  expect(delays.slice(0, 4)).toEqual([250, 500, 800, 800]);
  expect(Math.max(...delays)).toBe(800);
  expect(backoff.next(GONE)).toBeLessThanOrEqual(1000);
});

test("pages do not come back all at once", () => {
  expect(new Backoff(() => 1).next(GONE)).toBeLessThan(new Backoff(() => 0).next(GONE));
});
