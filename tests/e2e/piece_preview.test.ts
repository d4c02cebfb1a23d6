// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { readFileSync } from "node:fs";
import { fileURLToPath } from "node:url";
import { gunzipSync } from "node:zlib";
import type { Page } from "playwright-core";
import { SourcePages } from "./source_pages";

// The preview of cuts in the bundled head: client/web/tests/building/preview_page.ts is the page of a new plan without a server. A
// browser without a graphics card draws fewer triangles while a cut is dragged, and all of them at rest.

const HEAD = fileURLToPath(new URL("../data/ct/headsq/headsq_quarter.raw.gz", import.meta.url));
/** Longer than the page waits after the last change. */
const REST_MS = 500;

let pages: SourcePages;
beforeAll(async () => (pages = await SourcePages.start()));
afterAll(() => pages.stop());

async function openHead(): Promise<Page> {
  const page = await pages.open("tests/building/preview_page.html", { viewport: { width: 1280, height: 720 } });
  await page.waitForFunction(() => "draft" in globalThis);
  await page.evaluate((text) => {
    const { draft } = globalThis as any;
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    const grid = { size: [64, 64, 93], spacing: [3.2, 3.2, 1.5], origin: [0, 0, 0], directions: [[-1, 0, 0], [0, 1, 0], [0, 0, -1]] };
    draft.setVolume({ grid, values: new Int16Array(bytes.buffer).map((value) => value - 1024), kernel: "" }, null);
    draft.setCrosshair([-100, 36, -86]);
  }, gunzipSync(readFileSync(HEAD)).toString("base64"));
  await page.getByRole("button", { name: "4. Operation" }).click();
  return page;
}

/** Shifts the first plane back by so many millimeters from where it began; resolves once the answer is there. `isDone`: the hand lets go. */
async function shift(page: Page, mm: number, isDone: boolean): Promise<void> {
  const before = await page.locator(".pieces").textContent();
  await page.evaluate(([by, last]) => {
    const { draft, begun } = globalThis as any;
    const [x, y, z] = begun.point_mm;
    draft.movePlane("cut 0 0", { ...begun, point_mm: [x, y + Number(by), z] }, last);
  }, [mm, isDone] as const);
  if (!isDone) await expect.poll(() => page.locator(".pieces").textContent()).not.toBe(before);
}

const picture = (page: Page): Promise<Buffer> => page.locator(".plan-views .surface canvas").screenshot();

/** The picture of the bone once it has not changed for a while. */
async function pictureAtRest(page: Page): Promise<Buffer> {
  const same: Buffer[] = [await picture(page)];
  while (same.length < 4) {
    await page.waitForTimeout(REST_MS);
    const next = await picture(page);
    if (!next.equals(same[0])) same.length = 0;
    same.push(next);
  }
  return same[0];
}

test("the preview at rest after a drag is the one that a page shows which never saw the drag", async () => {
  const page = await openHead();
  await page.getByRole("button", { name: "Add", exact: true }).click();
  await page.getByRole("button", { name: "Set planes" }).click();
  await page.getByText(/mandible \d+\.\d cm³/).waitFor();
  await page.evaluate(() => Object.assign(globalThis, { begun: (globalThis as any).draft.planes[0].plane }));
  const first = await pictureAtRest(page);
  for (const mm of [4, 8, 12, 4]) await shift(page, mm, false);
  await shift(page, 0, true);
  await expect.poll(async () => (await picture(page)).equals(first)).toBe(true);
  await shift(page, 12, false);
  await shift(page, 12, true);
  const moved = await pictureAtRest(page);
  expect(moved.equals(first)).toBe(false);

  const recipe = await page.evaluate(() => (globalThis as any).draft.recipe);
  const other = await openHead();
  await other.evaluate((wanted) => (globalThis as any).draft.change(wanted), recipe);
  await other.getByText(/mandible \d+\.\d cm³/).waitFor();
  await expect.poll(async () => (await picture(other)).equals(moved)).toBe(true);
});
