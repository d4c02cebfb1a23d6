// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Page } from "playwright-core";
import { Gateway } from "../../client/web/src/calls/gateway";
import { Planner, type Hook, live, openCase, openPage, state, takeSegment, typeMove } from "./planner";
import { SlowLine } from "./slow_line";

// Connections that are open and dead: a router or a proxy between page and gateway has forgotten them without closing them.

let planner: Planner;
let line: SlowLine;
let opened: Awaited<ReturnType<typeof openCase>>;
beforeAll(async () => {
  planner = await Planner.start();
  line = await SlowLine.open(planner.url, 0);
  opened = await openCase(await planner.browse(), { url: line.url, casePath: planner.casePath });
  await takeSegment(opened.page, "Lower jaw");
});
afterAll(async () => {
  line.close();
  await planner.stop();
});
afterEach(() => expect(opened.faults).toEqual([]));

/** From now on: every state of the connection, with the time since. */
function listen(page: Page): Promise<void> {
  return page.evaluate(() => {
    const begin = performance.now();
    const heard: [string, number][] = ((globalThis as any).heard = []);
    const dot = document.querySelector<HTMLElement>("header .dot");
    new MutationObserver(() => heard.push([dot?.dataset.kind ?? "", performance.now() - begin])).observe(dot as Node, { attributes: true });
  });
}

const heard = (page: Page): Promise<[string, number][]> => page.evaluate(() => (globalThis as any).heard);

/** How far forward the lower jaw is by what the server keeps; asked past the line. */
async function keptForwardMm(session: string): Promise<number> {
  const { committedPoses } = await new Gateway(planner.url).sessions.getSession({ name: session });
  const { x = 0, y = 0, z = 0 } = committedPoses.find(({ handle }) => handle === "mandible")?.translationMm ?? {};
  return Math.hypot(x, y, z);
}

const isKept = (page: Page) => page.waitForFunction(() => (globalThis as unknown as Hook).tissueform.bench.live.isKept);

test("a move that a dead connection swallows is waited for, sent again, and kept", async () => {
  const { page } = opened;
  await typeMove(page, "Forward", "3");
  await isKept(page);
  await live(page);
  await listen(page);
  line.mute();
  await typeMove(page, "Forward", "7");
  await page.getByText("Waiting for the server").waitFor();
  expect((await state(page)).connection).toBe("waiting");
  await page.waitForFunction(() => (globalThis as any).heard.some(([kind]: [string]) => kind === "live"));
  await isKept(page);
  expect(await keptForwardMm((await state(page)).session)).toBeCloseTo(7, 6);
  const states = await heard(page);
  expect(states.map(([kind]) => kind)).toEqual(["waiting", "broken", "live"]);
  // By the page's clock, which a busy machine does not hurry.
  expect(states[0][1]).toBeGreaterThan(1000);
  expect(states[1][1]).toBeGreaterThan(states[0][1] + 4000);
});

test("while the hand rests the page finds out, too", async () => {
  const { page } = opened;
  await listen(page);
  line.mute();
  await page.waitForFunction(() => (globalThis as any).heard.some(([kind]: [string]) => kind === "live"));
  expect((await heard(page)).map(([kind]) => kind)).toEqual(["waiting", "broken", "live"]);
});

test("a follower does not see a stale picture as a live one, and sees the next move", async () => {
  const { session } = await state(opened.page);
  const link = opened.page.url().replace("#case=", `#follow=${session.replace("sessions/", "")}&case=`);
  const { page, faults } = await openPage(await planner.browse(), link);
  await page.getByText("Live", { exact: true }).waitFor();
  await listen(page);
  line.mute();
  await page.waitForFunction(() => (globalThis as any).heard.some(([kind]: [string]) => kind === "live"));
  expect((await heard(page)).map(([kind]) => kind)).toEqual(["waiting", "broken", "live"]);
  await live(opened.page);
  const numberOf = () => page.evaluate(() => Number((globalThis as unknown as Hook).tissueform.follower.number));
  const before = await numberOf();
  await typeMove(opened.page, "Forward", "5");
  await expect.poll(numberOf).toBeGreaterThan(before);
  expect(faults).toEqual([]);
});

test("stored predictions are listed though the browser's kept connections are dead", async () => {
  const { page } = opened;
  await isKept(page);
  line.mute();
  const before = line.opened;
  await page.evaluate(() => (globalThis as unknown as Hook).tissueform.bench.stored.load());
  expect(line.opened).toBeGreaterThan(before);
});

test("a case that comes over 1.5 Mbit/s says all the time how far it is", async () => {
  const narrow = await SlowLine.open(planner.url, 0, 1.5e6 / 8);
  const context = await planner.browse();
  // What the page shows below the bar, as it changes.
  await context.addInitScript(() => {
    const shown: string[] = ((globalThis as any).shown = []);
    const look = () => {
      const text = document.querySelector(".sheet .told")?.textContent ?? "";
      if (text !== shown[shown.length - 1]) shown.push(text);
    };
    new MutationObserver(look).observe(document, { subtree: true, childList: true, characterData: true });
  });
  const { hash } = new URL(opened.page.url());
  const { page, faults } = await openPage(context, `${narrow.url}/${hash}`);
  await page.locator(".planner header").waitFor();
  const shown: string[] = await page.evaluate(() => (globalThis as any).shown);
  const steps = shown.flatMap((text) => /^(\d+\.\d) of (\d+\.\d) MB, (\d+) %$/.exec(text)?.slice(1).map(Number) ?? []);
  const [megabytes, totals, percents] = [0, 1, 2].map((k) => steps.filter((_, i) => i % 3 === k));
  expect(new Set(totals).size).toBe(1);
  // In steps of 128 KiB, some of which come together.
  expect(percents.length).toBeGreaterThan(totals[0] / 0.3);
  expect(percents[0]).toBe(0);
  expect(percents[percents.length - 1]).toBe(100);
  expect(percents).toEqual([...percents].sort((a, b) => a - b));
  expect(megabytes[megabytes.length - 1]).toBe(totals[0]);
  expect(faults).toEqual([]);
  narrow.close();
});
