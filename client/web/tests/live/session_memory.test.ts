// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { beforeEach, expect, test, vi } from "vitest";
import { claimSession, forgetAbandoned, forgetSession, newSession } from "../../src/live/session_memory";

/** One browser: what its tabs share, and which locks they hold. */
const shared = new Map<string, string>();
const locks = new Set<string>();

const storage = (map: Map<string, string>) => ({
  getItem: (key: string) => map.get(key) ?? null,
  setItem: (key: string, value: string) => void map.set(key, value),
  removeItem: (key: string) => void map.delete(key),
});

const lockManager = {
  request(name: string, options: { signal?: AbortSignal }, hold: (lock: unknown) => unknown) {
    if (!locks.has(name)) {
      locks.add(name);
      return Promise.resolve(hold({ name }));
    }
    if (options.signal !== undefined) return Promise.reject(new Error("waited in vain"));
    return Promise.resolve(hold(null));
  },
  query: () => Promise.resolve({ held: Array.from(locks, (name) => ({ name })) }),
};

/** What follows runs in this tab, which remembers `own` from before, on the page of this path. */
function tab(own: Map<string, string> = new Map(), path = "/"): Map<string, string> {
  vi.stubGlobal("location", new URL(path, "https://hospital.example.org"));
  vi.stubGlobal("sessionStorage", storage(own));
  vi.stubGlobal("localStorage", storage(shared));
  vi.stubGlobal("navigator", { locks: lockManager });
  return own;
}

beforeEach(() => {
  shared.clear();
  locks.clear();
});

test("a name has 128 random bits", async () => {
  tab();
  const names = new Set(await Promise.all(Array.from({ length: 50 }, () => newSession("cases/a"))));
  expect(names.size).toBe(50);
  for (const name of names) expect(name).toMatch(/^sessions\/[0-9a-f]{32}$/);
});

test("a reload finds its own session, another tab gets one of its own", async () => {
  const own = tab();
  const first = await claimSession("cases/a");
  expect(first.isOld).toBe(false);
  tab();
  const second = await claimSession("cases/a");
  expect(second.session).not.toBe(first.session);
  locks.delete(first.session);
  tab(own);
  expect(await claimSession("cases/a")).toEqual({ session: first.session, isOld: true });
});

test("a copied tab does not take the session of the one it was copied from", async () => {
  const own = tab();
  const first = await claimSession("cases/a");
  tab(new Map(own));
  expect((await claimSession("cases/a")).session).not.toBe(first.session);
});

test("a second visit finds the newest session of its case", async () => {
  tab();
  await newSession("cases/a");
  const newest = await newSession("cases/a");
  await newSession("cases/b");
  locks.clear();
  tab();
  expect(await claimSession("cases/a")).toEqual({ session: newest, isOld: true });
});

test("what no tab holds is abandoned, once", async () => {
  tab();
  const gone = await newSession("cases/a");
  const held = await newSession("cases/b");
  locks.delete(gone);
  expect(await forgetAbandoned("sessions/other")).toEqual([gone]);
  expect(await forgetAbandoned("sessions/other")).toEqual([]);
  locks.clear();
  expect(await forgetAbandoned(held)).toEqual([]);
});

test("a session that was ended is not found again", async () => {
  tab();
  const { session } = await claimSession("cases/a");
  forgetSession(session);
  locks.clear();
  expect((await claimSession("cases/a")).isOld).toBe(false);
});

test.each(["", "no JSON", "{}", "[1, null, {\"session\": 4}]"])("a memory of %j is as none", async (text) => {
  tab();
  shared.set("tissueform-sessions", text);
  expect((await claimSession("cases/a")).isOld).toBe(false);
});

test("a planner below another path of the same host leaves its neighbor's sessions alone", async () => {
  tab(new Map(), "/a/");
  const { session } = await claimSession("cases/a");
  locks.delete(session);
  tab(new Map(), "/b/");
  expect(await forgetAbandoned("")).toEqual([]);
  expect((await claimSession("cases/a")).isOld).toBe(false);
  tab(new Map(), "/a/#case=a");
  expect(await claimSession("cases/a")).toEqual({ session, isOld: true });
});
