// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { randomId } from "./session_opening";

// Which sessions this browser has made, so that a reload or a second visit finds its own again, and those whose tab is gone are
// deleted. A tab holds a lock of its session's name for as long as it lives, also through a crash of the tab.

const MOST_REMEMBERED = 64;
/** How long a page that is being reloaded may hold on to its session: on a busy machine it goes slowly. A tab that was duplicated waits as long. */
const RELOAD_MS = 4000;

/** Of this planner alone: a host may have several, each below a path of its own and with servers of its own. */
const key = (name: string) => name + new URL(".", location.href).pathname.replace(/\/$/, "");
const storageKey = () => key("tissueform-sessions");
const tabKey = () => key("tissueform-session");

interface Remembered {
  session: string;
  /** "cases/{sha256}" */
  case: string;
}

export interface Claim {
  session: string;
  /** It was there before: the server may have its poses. */
  isOld: boolean;
}

/** The session of this tab for `caseName`: its own from before a reload, else one of this case whose tab is gone, else a new one. */
export async function claimSession(caseName: string): Promise<Claim> {
  const own = sessionStorage.getItem(tabKey());
  const known = read().filter((entry) => entry.case === caseName);
  // The tab's own first, then the newest.
  for (const { session } of known.reverse().sort((a, b) => Number(b.session === own) - Number(a.session === own))) {
    if (await lock(session, session === own ? RELOAD_MS : 0)) {
      sessionStorage.setItem(tabKey(), session);
      return { session, isOld: true };
    }
  }
  return { session: await newSession(caseName), isOld: false };
}

/** A new name that is remembered as this tab's. */
export async function newSession(caseName: string): Promise<string> {
  const session = `sessions/${randomId()}`;
  await lock(session, 0);
  sessionStorage.setItem(tabKey(), session);
  write([...read(), { session, case: caseName }].slice(-MOST_REMEMBERED));
  return session;
}

/** Names that are remembered and that no tab holds, `except` one; they are forgotten. */
export async function forgetAbandoned(except: string): Promise<string[]> {
  if (navigator.locks === undefined) return [];
  const held = new Set(((await navigator.locks.query()).held ?? []).map((entry) => entry.name));
  const isKept = (entry: Remembered) => entry.session === except || held.has(entry.session);
  const all = read();
  write(all.filter(isKept));
  return all.filter((entry) => !isKept(entry)).map((entry) => entry.session);
}

export function forgetSession(session: string): void {
  write(read().filter((entry) => entry.session !== session));
  if (sessionStorage.getItem(tabKey()) === session) sessionStorage.removeItem(tabKey());
}

/** False where another tab holds it for longer than `patienceMs`. Without locks (a page that is not secure) a tab knows its own session only. */
function lock(session: string, patienceMs: number): Promise<boolean> {
  if (navigator.locks === undefined) return Promise.resolve(sessionStorage.getItem(tabKey()) === session);
  return new Promise((resolve) => {
    const options = patienceMs > 0 ? { signal: AbortSignal.timeout(patienceMs) } : { ifAvailable: true };
    const hold = (held: Lock | null) => {
      resolve(held !== null);
      return held === null ? undefined : new Promise<void>(() => {});
    };
    navigator.locks.request(session, options, hold).catch(() => resolve(false));
  });
}

function read(): Remembered[] {
  try {
    const entries: unknown = JSON.parse(localStorage.getItem(storageKey()) ?? "[]");
    if (!Array.isArray(entries)) return [];
    return entries.filter((entry): entry is Remembered => typeof entry?.session === "string" && typeof entry?.case === "string");
  } catch {
    return [];
  }
}

function write(entries: Remembered[]): void {
  localStorage.setItem(storageKey(), JSON.stringify(entries));
}
