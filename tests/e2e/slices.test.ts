// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { readFileSync } from "node:fs";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { gunzipSync } from "node:zlib";
import type { Page } from "playwright-core";
import { writeHead } from "./new_plan";
import { type Hook, Planner, moved, openCase, seriousFindings, state, takeSegment, typeMove } from "./planner";

// The slices of the planner, with the CT that the bundled head was made from. With TISSUEFORM_PICTURES=FOLDER they are also pictures,
// of which docs/planner.md shows one.

const CT = fileURLToPath(new URL("../data/ct/headsq", import.meta.url));

let planner: Planner;
beforeAll(async () => {
  planner = await Planner.start();
  planner.casePath = planner.packWholeHead();
});
afterAll(() => planner.stop());

async function openSlices(page: Page): Promise<void> {
  await page.getByRole("button", { name: "Slices" }).click();
  await page.locator(".slices").waitFor({ state: "visible" });
}

/** As a part of the page that reads CTs gives it to the workbench. */
async function showCt(page: Page): Promise<void> {
  const values = gunzipSync(readFileSync(join(CT, "headsq_quarter.raw.gz"))).toString("base64");
  await page.evaluate((text) => {
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    // As the recipe says: axes to the right, posterior and inferior; HU from -1024.
    const grid = { size: [64, 64, 93], spacing: [3.2, 3.2, 1.5], origin: [0, 0, 0], directions: [[-1, 0, 0], [0, 1, 0], [0, 0, -1]] };
    (globalThis as unknown as Hook).tissueform.bench.volume.value = { grid, values: new Int16Array(bytes.buffer).map((value) => value - 1024), kernel: "" };
    return new Promise<void>((done) => requestAnimationFrame(() => requestAnimationFrame(() => done())));
  }, values);
}

/** Where lines of this color are in a slice: the mean over the width, and how many pixels. */
function linesOf(page: Page, plane: string, [red, green, blue]: [number, number, number]) {
  return page.locator(`[data-plane=${plane}] .slice-surface`).evaluate((element, color) => {
    const canvas = element.querySelectorAll("canvas")[1];
    const { data, width } = canvas.getContext("2d")?.getImageData(0, 0, canvas.width, canvas.height) as ImageData;
    let [count, sum] = [0, 0];
    for (let i = 0; i < data.length / 4; ++i) {
      if (color.some((entry, k) => Math.abs(data[4 * i + k] - entry) > 12)) continue;
      count += 1;
      sum += i % width;
    }
    return { count, x: sum / count };
  }, [red, green, blue]);
}

const LOWER_JAW: [number, number, number] = [0xf0, 0xb5, 0x4a];
const MESH: [number, number, number] = [0x8f, 0xe0, 0x8f];
const PRE_OP: [number, number, number] = [0x9f, 0xc4, 0xff];

test("slices show bone and skin before and after, and follow the plan", async () => {
  const { page, faults } = await openCase(await planner.browse([], { viewport: { width: 1280, height: 800 } }), planner);
  await openSlices(page);
  await takeSegment(page, "Lower jaw");
  const before = await linesOf(page, "sagittal", LOWER_JAW);
  expect(before.count).toBeGreaterThan(20);
  await typeMove(page, "Forward", "8");
  await moved(page, 6, 10);
  // Anterior is at the left.
  await expect.poll(async () => (await linesOf(page, "sagittal", LOWER_JAW)).x).toBeLessThan(before.x - 3);
  expect((await linesOf(page, "sagittal", PRE_OP)).count).toBeGreaterThan(20);
  await showCt(page);
  expect(await seriousFindings(page)).toEqual([]);
  if (process.env.TISSUEFORM_PICTURES !== undefined) await page.screenshot({ path: join(process.env.TISSUEFORM_PICTURES, "slices.jpg"), type: "jpeg", quality: 90 });
  const press = (name: string) => page.locator(".slice-legend").getByRole("button", { name }).click();
  await press("Mesh, pre-op");
  await expect.poll(async () => (await linesOf(page, "sagittal", MESH)).count).toBeGreaterThan(50);
  await press("Lower jaw");
  await expect.poll(async () => (await linesOf(page, "sagittal", LOWER_JAW)).count).toBe(0);
  await page.getByRole("button", { name: "Slices" }).click();
  await page.locator(".slices").waitFor({ state: "hidden" });
  expect(faults).toEqual([]);
});

test("a CT is shown where it has the case's skin, and refused where it has not", async () => {
  const { page, faults } = await openCase(await planner.browse(), planner);
  await openSlices(page);
  const hasCt = () => page.evaluate(() => (globalThis as unknown as Hook).tissueform.bench.volume.value !== null);
  const choose = async (path: string) => {
    const [chooser] = await Promise.all([page.waitForEvent("filechooser"), page.getByRole("button", { name: "Open a CT" }).press("Enter")]);
    await chooser.setFiles(path);
  };
  await choose(writeHead(planner.folder, [0, 9, -12]));
  await page.getByText(/does not belong to the case: only \d+ % of the case's skin has skin of the CT within 3 mm/i).waitFor();
  expect(await hasCt()).toBe(false);
  await choose(writeHead(planner.folder));
  await page.getByText(/^The slices show the CT: it has skin where \d+ % of the case's skin is\.$/).waitFor();
  expect(await hasCt()).toBe(true);
  expect(await seriousFindings(page)).toEqual([]);
  expect(faults).toEqual([]);
});

test("keys in a slice move no bone", async () => {
  const { page } = await openCase(await planner.browse(), planner);
  await openSlices(page);
  await page.locator("[data-plane=axial] .slice-surface").focus();
  const label = () => page.locator("[data-plane=axial] .slice-surface").getAttribute("aria-label");
  const before = await label();
  for (const key of ["w", "a", "s", "d", "i", "PageUp", "PageUp"]) await page.keyboard.press(key);
  await expect.poll(label).not.toBe(before);
  expect((await state(page)).moves).toEqual((await state(page)).moves.map(() => expect.objectContaining({ forwardMm: 0, leftMm: 0, pitchDeg: 0 })));
});

test("a phone shows one slice in place of the picture", async () => {
  const { page } = await openCase(await planner.browse([], { viewport: { width: 390, height: 844 }, hasTouch: true }), planner);
  await openSlices(page);
  await showCt(page);
  expect(await page.locator(".slice-surface:visible").count()).toBe(1);
  expect(await page.evaluate(() => document.documentElement.scrollWidth)).toBeLessThanOrEqual(390);
  expect(await seriousFindings(page)).toEqual([]);
  if (process.env.TISSUEFORM_PICTURES !== undefined) await page.screenshot({ path: join(process.env.TISSUEFORM_PICTURES, "slices-phone.jpg"), type: "jpeg", quality: 90 });
  await page.getByRole("button", { name: "Slices" }).click();
  await page.locator(".picture").waitFor({ state: "visible" });
});
