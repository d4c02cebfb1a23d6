// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { existsSync, readdirSync, statSync } from "node:fs";
import { join } from "node:path";
import type { BrowserContext, Page } from "playwright-core";
import { goToStep, openNewPlan, prepare, writeHead, writeNoise } from "./new_plan";
import { Planner } from "./planner";
import { SlowLine } from "./slow_line";

// Builds that are canceled, that break off, and that a page finds again.

const SLOW_BYTES_PER_SECOND = 2 ** 20;

let planner: Planner;
let context: BrowserContext;
let head: string;
beforeAll(async () => {
  planner = await Planner.start();
  context = await planner.browse();
  head = writeHead(planner.folder);
});
afterAll(() => planner.stop());

/** Files of builds and of what was sent for them that the server holds, with their sizes. */
function onServer(kind: "files" | "plans"): { path: string; bytes: number }[] {
  const folder = join(planner.folder, "data/builds", kind);
  if (!existsSync(folder)) return [];
  const paths = readdirSync(folder, { recursive: true, encoding: "utf8" }).map((path) => join(folder, path));
  return paths.flatMap((path) => {
    const found = statSync(path, { throwIfNoEntry: false });
    return found?.isFile() ? [{ path, bytes: found.size }] : [];
  });
}

const sum = (numbers: readonly number[]) => numbers.reduce((total, number) => total + number, 0);
const sentBytes = () => sum(onServer("files").map(({ bytes }) => bytes));
const listed = (page: Page) => page.getByRole("region", { name: "Builds" }).getByRole("listitem").allTextContents();
const press = (page: Page, name: string) => page.getByRole("button", { name, exact: true }).click();

test("a build is in the list from its start, also of a page that was opened again; canceled there, it leaves nothing", async () => {
  const { page, faults } = await openNewPlan(context, planner.url);
  await prepare(page, head);
  await page.getByLabel("Title of the case").fill("Listed");
  await press(page, "Build the plan");
  await expect.poll(() => listed(page)).toEqual([expect.stringMatching(/^Listed(Building|Waiting)/)]);
  await page.close();

  const again = await openNewPlan(context, planner.url);
  await goToStep(again.page, "Build");
  await expect.poll(() => listed(again.page)).toEqual([expect.stringMatching(/^ListedBuilding: /)]);
  await again.page.getByRole("region", { name: "Builds" }).getByRole("button").click();
  await again.page.getByRole("status").getByText(/^Building/).waitFor();
  await press(again.page, "Cancel");
  await again.page.getByText("The build was canceled.", { exact: true }).waitFor();
  await expect.poll(() => listed(again.page)).toEqual([]);
  expect([onServer("files"), onServer("plans")]).toEqual([[], []]);
  await again.page.goto(planner.url);
  await again.page.getByRole("button", { name: "New plan from a CT" }).waitFor();
  expect(await again.page.getByText("Listed").count()).toBe(0);
  expect([...faults, ...again.faults]).toEqual([]);
  await again.page.close();
});

describe("a CT that is sent over a slow line", () => {
  let noise: string;
  let line: SlowLine;
  beforeAll(async () => {
    noise = writeNoise(planner.folder);
    line = await SlowLine.open(planner.url, 0, SLOW_BYTES_PER_SECOND);
  });
  afterAll(() => line.close());

  async function sendSome(): Promise<Page> {
    const { page } = await openNewPlan(context, line.url);
    await prepare(page, noise);
    await press(page, "Build the plan");
    await expect.poll(sentBytes).toBeGreaterThan(2 * 2 ** 20);
    return page;
  }

  test("and canceled leaves nothing", async () => {
    const page = await sendSome();
    await press(page, "Cancel");
    await page.getByText("The build was canceled.", { exact: true }).waitFor();
    await expect.poll(() => [onServer("files"), onServer("plans")]).toEqual([[], []]);
    expect(await listed(page)).toEqual([]);
    await page.close();
  });

  test("goes on where it broke off when its tab was closed and the CT is dropped again", async () => {
    await (await sendSome()).close();
    await new Promise((done) => setTimeout(done, 1000));
    const before = sentBytes();
    const { page } = await openNewPlan(context, planner.url);
    let sent = 0;
    page.on("websocket", (socket) => socket.on("framesent", ({ payload }) => (sent += payload.length)));
    await prepare(page, noise);
    await press(page, "Build the plan");
    await expect.poll(() => listed(page)).toHaveLength(1);
    const whole = statSync(noise).size;
    expect(before).toBeGreaterThan(2 * 2 ** 20);
    expect(sent).toBeGreaterThan(2 ** 20);
    expect(sent).toBeLessThan(1.1 * whole - before + 2 ** 18);
    // It is noise: one sentence says so.
    await expect.poll(() => page.getByRole("alert").allTextContents()).toContainEqual(expect.stringMatching(/^[^.]+[.]?$/));
    await page.close();
  });
});

test("a server that ends in the middle of a build gives one sentence, and says so when it is back", async () => {
  const { page, faults } = await openNewPlan(context, planner.url);
  await prepare(page, head);
  await page.getByLabel("Title of the case").fill("Broken off");
  await press(page, "Build the plan");
  await page.getByRole("status").getByText(/^Building: /).waitFor();
  await planner.killServer();
  await planner.startServer();
  const sentence = "The server ended while the plan was built; build it again";
  await expect.poll(async () => (await page.getByRole("alert").allTextContents()).filter((text) => text !== "")).toEqual([expect.stringMatching(new RegExp(sentence, "i"))]);
  await page.getByText("The build failed.", { exact: true }).waitFor();
  expect(await page.getByRole("button", { name: "Build the plan" }).isEnabled()).toBe(true);
  await expect.poll(async () => (await listed(page))[0]).toMatch(/^Broken offThe build failed\./);
  expect(onServer("plans").filter(({ path }) => /[/](plan|work)[/]/.test(path))).toEqual([]);
  expect(faults).toEqual([]);
  await page.close();
});
