// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { messageOf } from "../calls/call_error";
import type { Connection } from "../live/live_session";
import type { FollowLinks } from "../live/follow_links";
import { button, el, whileBusy } from "./dom";

/** "no followers", "2 follow" */
export function followersText(count: number): string {
  if (count === 0) return "no followers";
  return count === 1 ? "one follows" : `${count} follow`;
}

export interface StatusBar {
  element: HTMLElement;
  connection(connection: Connection): void;
  answered(roundTripMs: number): void;
  waiting(sinceMs: number): void;
  followers(count: number): void;
}

const FRESH_MS = 1000;

/** What a page's bar holds beside words. */
export interface StatusBarParts {
  /** Null on a follower's page. */
  links: FollowLinks | null;
  onLeave: (() => void) | null;
  onRetry: (() => void) | null;
  /** The signed-in user; null if no user is signed in. */
  account: HTMLElement | null;
}

/** How page and server stand to each other, in words. */
export function statusBar(title: string, { links, onLeave, onRetry, account }: StatusBarParts): StatusBar {
  const dot = el("span", { class: "dot", attributes: { "aria-hidden": "true" } });
  const state = el("span", { attributes: { role: "status" } });
  const age = el("span", { class: "quiet age" });
  const follow = el("span", { class: "quiet" });
  const progress = el("progress", { attributes: { max: "1", "aria-label": "Progress" } });
  progress.hidden = true;
  const retry = onRetry === null ? null : button("Try again", onRetry);
  const back = onLeave === null ? null : button("Cases", onLeave, { attributes: { title: "Back to the list of cases; the session ends" } });
  const element = el("header", {}, [
    back,
    el("h1", { text: title }),
    el("span", { class: "state" }, [dot, state, progress, age]),
    retry,
    follow,
    links === null ? null : linkButtons(links),
    el("span", { class: "notice-mark", text: "Not a medical device" }),
    account,
  ]);
  return {
    element,
    connection(connection) {
      dot.dataset.kind = connection.kind;
      // A narrow bar cuts it.
      state.title = state.textContent = describe(connection);
      const share = connection.kind === "preparing" ? connection.share : null;
      progress.hidden = connection.kind !== "preparing";
      if (share === null) progress.removeAttribute("value");
      else progress.value = share;
      if (retry !== null) retry.hidden = connection.kind !== "failed";
      age.hidden = connection.kind !== "live";
    },
    answered(roundTripMs) {
      age.textContent = roundTripMs < FRESH_MS ? `answered in ${Math.max(1, Math.round(roundTripMs))} ms` : `answered in ${(roundTripMs / 1000).toFixed(1)} s`;
    },
    waiting(sinceMs) {
      age.textContent = `waiting for ${(sinceMs / 1000).toFixed(1)} s`;
    },
    followers(count) {
      follow.textContent = followersText(count);
    },
  };
}

function describe(connection: Connection): string {
  switch (connection.kind) {
    case "live":
      return "Live";
    case "waiting":
      return "Waiting for the server";
    case "preparing":
      return connection.share === null ? `${connection.text} …` : `${connection.text}, ${Math.round(100 * connection.share)} %`;
    case "moving":
      return "Moving to another server…";
    case "broken":
      return `Reconnecting. ${connection.text}`;
    case "failed":
      return connection.text;
  }
}

/** Makes links for who follows, and ends them where the server knows who calls. */
function linkButtons(links: FollowLinks): HTMLElement {
  const status = el("span", { class: "quiet", attributes: { role: "status" } });
  const fail = (thrown: unknown) => (status.textContent = messageOf(thrown));
  const end = button("End links", () => {
    const run = async () => {
      await links.endAll();
      status.textContent = "all links were revoked";
    };
    void whileBusy(end, run, fail);
  });
  end.hidden = !links.hasLogins;
  const copy = button("Copy follow link", () => {
    const run = async () => {
      const { url, endsAt } = await links.make();
      const isCopied = await copyText(url);
      status.textContent = [isCopied ? "copied" : "", endsAt === null ? "" : `until ${timeText(endsAt)}`].filter((part) => part !== "").join(", ");
    };
    void whileBusy(copy, run, fail);
  });
  return el("span", { class: "links" }, [copy, end, status]);
}

const DAY_MS = 24 * 3_600_000;

/** With the day where that is not within the next 24 hours. */
export function timeText(time: Date): string {
  const isSoon = time.getTime() - Date.now() < DAY_MS;
  return isSoon ? time.toLocaleTimeString([], { timeStyle: "short" }) : time.toLocaleString([], { month: "short", day: "numeric", hour: "numeric", minute: "2-digit" });
}

async function copyText(text: string): Promise<boolean> {
  try {
    await navigator.clipboard.writeText(text);
    return true;
  } catch {
    // Without the right to write there the person copies it.
    window.prompt("Follow link", text);
    return false;
  }
}

/** Sentences that pass: the newest one is shown for a while, and read out. */
export function noticeBox(): { element: HTMLElement; show(text: string): void } {
  const element = el("div", { class: "notice", attributes: { role: "status", "aria-live": "polite" } });
  element.hidden = true;
  let timer: ReturnType<typeof setTimeout> | undefined;
  return {
    element,
    show(text) {
      clearTimeout(timer);
      element.textContent = text;
      element.hidden = text === "";
      timer = setTimeout(() => (element.hidden = true), 8000);
    },
  };
}
