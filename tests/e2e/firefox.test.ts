// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { existsSync, readFileSync } from "node:fs";
import { basename } from "node:path";
import puppeteer, { type Browser, type Page } from "puppeteer-core";
import { HEAD_RECIPE, writeHead } from "./new_plan";
import { type Hook, Planner } from "./planner";

// The planner in Firefox: the bundled whole head, answered by the page's WebAssembly, and a new plan from its CT.

const FIREFOX = process.env.TISSUEFORM_FIREFOX ?? "/usr/bin/firefox-esr";
const SECONDS = 1000;
/** Tolerance of the page's prepared answers. */
const MOST_APART_MM = 0.02;

const noFirefox = !existsSync(FIREFOX) ? `${FIREFOX} is not there` : process.env.DISPLAY === undefined ? "there is no display, without which Firefox has no WebGL (xvfb-run gives one)" : "";
if (noFirefox !== "") console.warn(`in Firefox: skipped, ${noFirefox}`);

describe.skipIf(noFirefox !== "")("in Firefox", () => {
  let planner: Planner;
  let firefox: Browser;
  const faults: string[] = [];

  beforeAll(async () => {
    planner = await Planner.start(undefined, { server: ["--plan-builds", "1"] });
    firefox = await puppeteer.launch({ browser: "firefox", executablePath: FIREFOX, headless: false, defaultViewport: { width: 1280, height: 720 } });
  });
  afterEach(() => expect(faults).toEqual([]));
  afterAll(async () => {
    await firefox?.close();
    await planner?.stop();
  });

  async function openPage(url: string): Promise<Page> {
    const page = await firefox.newPage();
    page.on("pageerror", (error) => faults.push(String(error)));
    page.on("request", (request) => request.url().startsWith("http") && !request.url().startsWith(planner.url) && faults.push(`asked ${new URL(request.url()).host}`));
    page.setDefaultTimeout(90 * SECONDS);
    await page.goto(url);
    return page;
  }

  /** As a user who drops it. */
  function giveFile(page: Page, path: string): Promise<void> {
    return page.$eval(
      "input[type=file]",
      (input, name, text) => {
        const files = new DataTransfer();
        files.items.add(new File([Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0))], name));
        (input as HTMLInputElement).files = files.files;
        input.dispatchEvent(new Event("change", { bubbles: true }));
      },
      basename(path),
      readFileSync(path).toString("base64"),
    );
  }

  async function live(page: Page): Promise<void> {
    await page.waitForFunction(() => {
      const bench = (globalThis as unknown as Hook).tissueform?.bench;
      return bench?.connection.value.kind === "live" && bench.picture.value !== null;
    });
  }

  /** How far the skin on the stage is from rest at most, in mm. */
  function largestMm(page: Page): Promise<number> {
    return page.evaluate(() => {
      const { shape } = (globalThis as unknown as Hook).tissueform.view.head.skins[0];
      let largest = 0;
      for (let i = 0; i < shape.positions.length; i += 3) largest = Math.max(largest, Math.hypot(...[0, 1, 2].map((k) => shape.positions[i + k] - shape.rest[i + k])));
      return largest;
    });
  }

  test("the whole head rests, follows a move by the page's own answers, and the server confirms them", async () => {
    const page = await openPage(planner.url);
    await page.waitForSelector("input[type=file]");
    await giveFile(page, planner.packWholeHead());
    await live(page);
    expect(await largestMm(page)).toBeLessThan(1e-3);
    expect(await page.evaluate(() => (globalThis as unknown as Hook).tissueform.view.stage.hasRenderer)).toBe(true);
    await page.locator("::-p-text(Linear elastic)").click();
    await page.waitForFunction(() => {
      const state = (globalThis as unknown as Hook).tissueform.bench.localState.value;
      return state.kind === "ready" && state.place === "page" && state.hasWorkers;
    });
    const offMm = await page.evaluate(async () => {
      const { bench } = (globalThis as unknown as Hook).tissueform;
      bench.plan.change(1, { forwardMm: 5, pitchDeg: 2 }, true);
      const poses = bench.plan.poses();
      const own = await bench.local.positionsAt(poses);
      const { displacements } = await bench.answers.solve(bench.live.session, bench.model.value, poses);
      return (own as Float32Array).reduce((most, value, i) => Math.max(most, Math.abs(value - bench.rest[i] - displacements[i])), 0);
    });
    expect(offMm).toBeLessThan(MOST_APART_MM);
    await expect.poll(() => largestMm(page)).toBeGreaterThan(4);
    await page.close();
  });

  test("a CT becomes a plan that opens and moves", async () => {
    const page = await openPage(`${planner.url}/#new`);
    await page.waitForSelector("input[type=file]");
    await giveFile(page, writeHead(planner.folder));
    await page.waitForSelector(".plan-views canvas");
    await page.evaluate((recipe) => (globalThis as any).tissueform.draft.change(recipe), { ...HEAD_RECIPE, spacing_mm: 2.5, mesh: { edge_mm: 7, fine_edge_mm: 6 } });
    await page.locator("nav[aria-label=Steps] button::-p-text(Build)").click();
    await page.locator("button::-p-text(Build the plan)").click();
    await page.waitForFunction(() => Array.from(document.querySelectorAll("button")).some((button) => button.textContent === "Open the planner"));
    // Coarse as it is, it is not ready, and its cautions have to be read.
    await page.locator("summary::-p-text(caution)").click();
    await page.locator("label::-p-text(I have read this)").click();
    await page.locator("button::-p-text(Open the planner)").click();
    await live(page);
    expect(await largestMm(page)).toBeLessThan(1e-3);
    await page.evaluate(() => (globalThis as unknown as Hook).tissueform.bench.plan.change(0, { forwardMm: 8 }, true));
    await expect.poll(() => largestMm(page), { timeout: 30 * SECONDS }).toBeGreaterThan(3);
    await page.close();
  });
});
