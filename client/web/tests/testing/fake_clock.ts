// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Timer } from "../../src/calls/backoff";

/** Time that passes when a test says so. */
export class FakeClock {
  nowMs = 0;
  private readonly timers = new Set<{ dueMs: number; action: () => void }>();

  readonly timer: Timer = (action, delayMs) => {
    const entry = { dueMs: this.nowMs + delayMs, action };
    this.timers.add(entry);
    return () => this.timers.delete(entry);
  };

  /** Runs what is due within these seconds, the earliest first. */
  pass(seconds: number): void {
    const endMs = this.nowMs + 1000 * seconds;
    for (;;) {
      const [next] = [...this.timers].filter(({ dueMs }) => dueMs <= endMs).sort((a, b) => a.dueMs - b.dueMs);
      if (next === undefined) break;
      this.timers.delete(next);
      this.nowMs = next.dueMs;
      next.action();
    }
    this.nowMs = endMs;
  }
}
