// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Connection } from "../live/live_session";
import { button, el } from "./dom";

/** "nobody follows", "2 follow" */
export function followersText(count: number): string {
  if (count === 0) return "nobody follows";
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

/** How page and server stand to each other, in words; `link`: what a follower opens, null on a follower's page. */
export function statusBar(title: string, link: (() => string) | null, onLeave: () => void, onRetry: (() => void) | null): StatusBar {
  const dot = el("span", { class: "dot", attributes: { "aria-hidden": "true" } });
  const state = el("span", { attributes: { role: "status" } });
  const age = el("span", { class: "quiet age" });
  const follow = el("span", { class: "quiet" });
  const progress = el("progress", { attributes: { max: "1", "aria-label": "Progress" } });
  progress.hidden = true;
  const retry = onRetry === null ? null : button("Try again", onRetry);
  const copied = el("span", { class: "quiet", attributes: { role: "status" } });
  const copy = link === null ? null : button("Copy follow link", () => void copyLink(link(), copied));
  const back = button("Cases", onLeave, { attributes: { title: "Back to the list of cases; the session ends" } });
  const element = el("header", {}, [
    link === null ? null : back,
    el("h1", { text: title }),
    el("span", { class: "state" }, [dot, state, progress, age]),
    retry,
    follow,
    copy,
    copied,
    el("span", { class: "notice-mark", text: "Not a medical device" }),
  ]);
  return {
    element,
    connection(connection) {
      dot.dataset.kind = connection.kind;
      state.textContent = describe(connection);
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
    case "preparing":
      return connection.share === null ? `${connection.text} …` : `${connection.text}, ${Math.round(100 * connection.share)} %`;
    case "broken":
      return `Connecting again. ${connection.text}`;
    case "failed":
      return connection.text;
  }
}

async function copyLink(link: string, told: HTMLElement): Promise<void> {
  try {
    await navigator.clipboard.writeText(link);
    told.textContent = "copied";
  } catch {
    // Without the right to write there the person copies it.
    window.prompt("Link for who follows", link);
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
