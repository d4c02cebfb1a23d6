// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

/** After so long without a change the hand rests. */
const REST_MS = 400;

/** What the page asks for a face: dropped when the hand moves on before it is known. */
export class Rest {
  private timer: ReturnType<typeof setTimeout> | undefined;
  private count = 0;
  private hasFound = false;

  /** The face changes. */
  over(): void {
    this.count += 1;
    clearTimeout(this.timer);
  }

  /** Whether `begin` with `atOnce` calls `use` before the next picture: at first, parts of the page have to be fetched. */
  get isQuick(): boolean {
    return this.hasFound;
  }

  /** `use` gets what `ask` finds, unless the face changes before. What cannot be found leaves what is shown. Where the page answers within the picture it asks `atOnce`, otherwise when the hand rests. */
  begin<Found>(ask: () => Promise<Found>, use: (found: Found) => void, atOnce: boolean): void {
    this.over();
    const asked = this.count;
    const answer = async () => {
      const found = await ask();
      this.hasFound = true;
      if (asked === this.count) use(found);
    };
    const begin = () => void answer().catch(() => {});
    if (atOnce) begin();
    else this.timer = setTimeout(begin, REST_MS);
  }
}
