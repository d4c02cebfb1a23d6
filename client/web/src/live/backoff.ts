// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

/** Runs `action` after a while; the result stops it. Tests have their own. */
export type Timer = (action: () => void, delayMs: number) => () => void;

export const browserTimer: Timer = (action, delayMs) => {
  const id = setTimeout(action, delayMs);
  return () => clearTimeout(id);
};

const FIRST_MS = 250;
const LONGEST_MS = 5000;

/** How long to wait before each further try: twice as long each time, up to 5 s, a fifth at random so that pages spread. */
export class Backoff {
  private tries = 0;

  constructor(private readonly random: () => number = Math.random) {}

  next(): number {
    const delay = Math.min(LONGEST_MS, FIRST_MS * 2 ** this.tries++);
    return delay * (1 - 0.2 * this.random());
  }

  reset(): void {
    this.tries = 0;
  }
}
