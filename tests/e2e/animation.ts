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

/** Python with Pillow, which matplotlib needs: pictures and milliseconds to a WebP animation with the seconds in a corner. */
const ASSEMBLE = `
import json, sys
from PIL import Image, ImageDraw
frames = json.load(sys.stdin)
images, times = [], []
size = Image.open(frames["pictures"][-1]["path"]).size
for frame in frames["pictures"]:
    image = Image.open(frame["path"]).convert("RGB")
    if image.size != size:
        continue  # before the window had its size
    times.append(frame["ms"])
    image = image.resize((frames["width"], round(image.height * frames["width"] / image.width)), Image.LANCZOS)
    draw = ImageDraw.Draw(image)
    draw.rectangle((4, image.height - 20, 64, image.height - 4), fill="black")
    draw.text((8, image.height - 18), frame["label"], fill="white")
    images.append(image)
images[0].save(frames["out"], save_all=True, append_images=images[1:], duration=times, loop=0, quality=60)
`;

/** The frames one after the other, each with its time as recorded, shown `faster`, none longer than `mostMs`. Returns the seconds that were recorded. */
export function writeAnimation(frames: readonly Frame[], path: string, { faster, mostMs = Infinity }: { faster: number; mostMs?: number }): number {
  const folder = mkdtempSync(join(tmpdir(), "tissueform-frames-"));
  const seconds = frames.map(({ atSeconds }) => atSeconds - frames[0].atSeconds);
  const pictures = frames.map(({ png }, i) => {
    const frame = join(folder, `${i}.png`);
    writeFileSync(frame, png);
    const standsMs = (1000 * ((seconds[i + 1] ?? seconds[i] + 2) - seconds[i])) / faster;
    return { path: frame, ms: Math.max(20, Math.round(Math.min(mostMs, standsMs))), label: `${seconds[i].toFixed(2)} s` };
  });
  execFileSync("/usr/bin/python3", ["-c", ASSEMBLE], { input: JSON.stringify({ pictures, width: 720, out: path }) });
  rmSync(folder, { recursive: true });
  return seconds[seconds.length - 1];
}
