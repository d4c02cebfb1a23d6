// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

/** After so long without a change the hand rests. */
const REST_MS = 400;

/** What takes some dozens of answers: asked when the hand rests, and dropped when it moves again. */
export class Rest {
  private timer: ReturnType<typeof setTimeout> | undefined;
  private count = 0;

  /** The face changes. */
  over(): void {
    this.count += 1;
    clearTimeout(this.timer);
  }

  /** `use` gets what `ask` finds, unless the face changes before. What cannot be found leaves what is shown. */
  begin<Found>(ask: () => Promise<Found>, use: (found: Found) => void): void {
    this.over();
    const asked = this.count;
    const answer = async () => {
      const found = await ask();
      if (asked === this.count) use(found);
    };
    this.timer = setTimeout(() => void answer().catch(() => {}), REST_MS);
  }
}
