// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { BrowserContextOptions, CDPSession, Page } from "playwright-core";

export type Point = readonly [x: number, y: number];

/** A phone or tablet of this size. */
export function touchDevice(width: number, height: number): BrowserContextOptions {
  return { viewport: { width, height }, isMobile: true, hasTouch: true, deviceScaleFactor: 2 };
}

/** Fingers on the screen, as the browser gets them from the device. */
export class Fingers {
  private constructor(
    private readonly page: Page,
    private readonly session: CDPSession,
  ) {}

  static async on(page: Page): Promise<Fingers> {
    return new Fingers(page, await page.context().newCDPSession(page));
  }

  /** Where all of them are now: those that were not there go down, those of the same place in the list move. */
  async put(...points: Point[]): Promise<void> {
    await this.send(this.count < points.length ? "touchStart" : "touchMove", points);
  }

  async lift(): Promise<void> {
    await this.send("touchEnd", []);
  }

  /** The system takes the gesture over. */
  async cancel(): Promise<void> {
    await this.send("touchCancel", []);
  }

  /** From the first to the last of these, each finger on a straight line. */
  async draw(from: Point[], to: Point[], steps = 5): Promise<void> {
    await this.put(...from);
    for (let step = 1; step <= steps; ++step) {
      await this.put(...from.map(([x, y], i): Point => [x + ((to[i][0] - x) * step) / steps, y + ((to[i][1] - y) * step) / steps]));
    }
  }

  private count = 0;

  private async send(type: "touchStart" | "touchMove" | "touchEnd" | "touchCancel", points: Point[]): Promise<void> {
    this.count = points.length;
    await this.session.send("Input.dispatchTouchEvent", { type, touchPoints: points.map(([x, y], id) => ({ x, y, id })) });
    // The page hears of moves once a frame.
    await this.page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
  }
}
