// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { execFileSync } from "node:child_process";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import type { Page } from "playwright-core";

// What a page showed while it was used, as an animation of docs/images.

export type Frame = { atSeconds: number; png: Buffer };

/** Pictures of the page as they were drawn, with the time of each in seconds: those that differ from the one before. */
export async function record(page: Page, act: () => Promise<void>): Promise<Frame[]> {
  const frames: Frame[] = [];
  const session = await page.context().newCDPSession(page);
  session.on("Page.screencastFrame", ({ data, sessionId, metadata }) => {
    const png = Buffer.from(data, "base64");
    if (!frames.at(-1)?.png.equals(png)) frames.push({ atSeconds: metadata.timestamp ?? 0, png });
    // The page may be gone by then.
    session.send("Page.screencastFrameAck", { sessionId }).catch(() => {});
  });
  await session.send("Page.startScreencast", { format: "png", everyNthFrame: 1 });
  await act();
  await session.send("Page.stopScreencast");
  return frames;
}

/**
 * By ImageMagick: the frames one after the other, each with its time as recorded, shown `faster`, none longer than `mostMs`.
 * Returns the seconds that were recorded.
 */
export function writeAnimation(frames: readonly Frame[], path: string, { faster, mostMs = Infinity }: { faster: number; mostMs?: number }): number {
  const folder = mkdtempSync(join(tmpdir(), "tissueform-frames-"));
  const seconds = frames.map(({ atSeconds }) => atSeconds - frames[0].atSeconds);
  const words = frames.flatMap(({ png }, i) => {
    const frame = join(folder, `${i}.png`);
    writeFileSync(frame, png);
    const standsMs = Math.min(mostMs, (1000 * ((seconds[i + 1] ?? seconds[i] + 1) - seconds[i])) / faster);
    return ["(", "-delay", `${Math.max(2, Math.round(standsMs / 10))}x100`, frame, "-gravity", "SouthWest", "-fill", "white", "-undercolor", "#000c", "-pointsize", "18", "-annotate", "+8+8", ` ${seconds[i].toFixed(2)} s `, ")"];
  });
  execFileSync("convert", [...words, "-resize", "720x", "+dither", "-colors", "48", "+map", "-layers", "Optimize", "-loop", "0", path]);
  rmSync(folder, { recursive: true });
  return seconds[seconds.length - 1];
}
