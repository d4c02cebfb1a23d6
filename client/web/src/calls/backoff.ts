// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { CallError } from "./call_error";

/** Runs `action` after a while; the result stops it. Tests have their own. */
export type Timer = (action: () => void, delayMs: number) => () => void;

export const browserTimer: Timer = (action, delayMs) => {
  const id = setTimeout(action, delayMs);
  return () => clearTimeout(id);
};

const FIRST_MS = 250;
const LONGEST_MS = 5000;
/** While servers of a cluster say that the session is moving: it is free within seconds, and the hand waits. */
const LONGEST_MOVING_MS = 800;
const MOST_HOPS = 4;
/** A stream that ends sooner has come to nothing: a server may let streams begin and end them at once. */
const LASTING_MS = 2000;

/**
 * How long to wait before each further try: twice as long each time, up to 5 s, a fifth at random so that pages spread. Not at
 * all where an error says which server to ask instead, up to four times in a row, and once where it says that there is another.
 * After a success that lasted it starts again.
 */
export class Backoff {
  private tries = 0;
  private hops = 0;
  private hasMoved = false;
  /** The first success since the last failure. */
  private since: number | null = null;

  constructor(
    private readonly random: () => number = Math.random,
    private readonly now: () => number = () => performance.now(),
  ) {}

  next(error?: CallError): number {
    this.judgeSuccess();
    if (error !== undefined && this.isAtOnce(error)) return 0;
    this.hops = 0;
    const delay = Math.min(error?.isElsewhere ? LONGEST_MOVING_MS : LONGEST_MS, FIRST_MS * 2 ** this.tries);
    // What follows on a move does not wait long because the move took long.
    if (!error?.isElsewhere || delay < LONGEST_MOVING_MS) this.tries += 1;
    return delay * (1 - 0.2 * this.random());
  }

  succeeded(): void {
    this.since ??= this.now();
  }

  private judgeSuccess(): void {
    if (this.since !== null && this.now() - this.since >= LASTING_MS) [this.tries, this.hops, this.hasMoved] = [0, 0, false];
    this.since = null;
  }

  private isAtOnce(error: CallError): boolean {
    if (!error.isMoved || (error.node === "" ? this.hasMoved : this.hops === MOST_HOPS)) return false;
    if (error.node === "") this.hasMoved = true;
    else this.hops += 1;
    return true;
  }
}
