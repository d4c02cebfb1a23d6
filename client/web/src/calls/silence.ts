// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Timer } from "./backoff";

const FIRST_S = 8;
const LONGEST_S = 64;

/**
 * How long calls of one kind may hear nothing before the page gives them up: 8 s at first. On a slow line, or where an answer takes
 * long, that is too short, and the page would open connections without end. So every call that is given up doubles the time, and
 * the time stays above 1.5 times the longest silence that ended. An answer shows that the time suffices, and so does a call that
 * lasts longer than it.
 */
export class Patience {
  private givenUp = 0;
  private longestS = 0;

  get seconds(): number {
    return Math.min(LONGEST_S, Math.max(FIRST_S, 1.5 * this.longestS) * 2 ** this.givenUp);
  }

  gaveUp(): void {
    this.givenUp += 1;
  }

  /** What a call has waited for has come. */
  answered(): void {
    this.givenUp = 0;
  }

  /** A call of this age has heard something after so long a silence. */
  heard(silentS: number, ageS: number): void {
    if (ageS > this.seconds) this.givenUp = 0;
    this.longestS = Math.max(this.longestS, silentS);
  }
}

/**
 * Counts seconds of silence. By a timer that runs again and again, not by the time of day: a page that was asleep, or busy, has
 * not listened, and hears what waits for it before the next second is counted.
 */
export class SilenceClock {
  private silentS = 0;
  private ageS = 0;
  private stopTimer: (() => void) | null = null;

  /** `onSecond` receives the length of the silence. No silence is counted while `isListening` is false. */
  constructor(
    private readonly patience: Patience,
    private readonly timer: Timer,
    private readonly isListening: () => boolean,
    private readonly onSecond: (silentS: number) => void,
  ) {
    this.restart();
  }

  /** Counts from now. */
  restart(): void {
    this.stop();
    this.silentS = 0;
    this.stopTimer = this.timer(() => this.tick(), 1000);
  }

  heard(): void {
    this.patience.heard(this.silentS, this.ageS);
    this.silentS = 0;
  }

  stop(): void {
    this.stopTimer?.();
    this.stopTimer = null;
  }

  private tick(): void {
    this.ageS += 1;
    this.silentS = this.isListening() ? this.silentS + 1 : 0;
    this.stopTimer = this.timer(() => this.tick(), 1000);
    this.onSecond(this.silentS);
  }
}
