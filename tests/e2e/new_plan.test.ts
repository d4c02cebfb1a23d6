// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { execFileSync } from "node:child_process";
import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import type { Page } from "playwright-core";
import { BIN, Planner, live, moved, openPage, saveExport, seriousFindings, typeMove } from "./planner";

// From a CT to a face that follows, without leaving the browser: the bundled head as a volume, a cut that is set and moved, the
// build on the server, its report, the planner. In the end the command line makes the same plan of the same recipe.

const HEAD = fileURLToPath(new URL("../data/ct/headsq", import.meta.url));
/** Patient directions as the recipes of tests/data/plans give them ("RPI"). */
const HEADER = [
  "NRRD0004",
  "type: int16",
  "dimension: 3",
  "space: left-posterior-superior",
  "sizes: 64 64 93",
  "space directions: (-3.2,0,0) (0,3.2,0) (0,0,-1.5)",
  "endian: little",
  "encoding: gzip",
  "# scanned on 1961-04-12 for Planted^Patient",
  "space origin: (0,0,0)",
  "",
  "",
].join("\n");

/** Of a patient, in the file and in its name. */
const PLANTED = ["Planted", "1961-04-12"];
const FILE = "Planted^Patient 1961-04-12.nrrd";


let planner: Planner;
let page: Page;
let faults: string[];
/** All that left the page. */
const sent: Buffer[] = [];

const step = (name: string) => page.getByRole("navigation", { name: "Steps" }).getByRole("button", { name }).click();
const recipe = async () => JSON.parse(await page.evaluate(() => JSON.stringify((globalThis as any).tissueform.draft.recipe)));
const number = (label: string) => page.getByRole("textbox", { name: label });

async function type(label: string, value: string): Promise<void> {
  await number(label).fill(value);
  await number(label).press("Enter");
}

beforeAll(async () => {
  planner = await Planner.start();
  writeFileSync(join(planner.folder, FILE), Buffer.concat([Buffer.from(HEADER), readFileSync(join(HEAD, "headsq_quarter.raw.gz"))]));
  const context = await planner.browse();
  context.on("page", (opened) => {
    opened.on("request", (request) => sent.push(Buffer.from(request.url()), request.postDataBuffer() ?? Buffer.alloc(0)));
    opened.on("websocket", (socket) => socket.on("framesent", ({ payload }) => sent.push(Buffer.from(payload))));
  });
  ({ page, faults } = await openPage(context, planner.url));
});

afterAll(async () => {
  expect(faults).toEqual([]);
  await planner.stop();
});

test("the first page leads to a new plan", async () => {
  await page.getByRole("button", { name: "New plan from a CT" }).click();
  await page.getByRole("heading", { name: "New plan from a CT" }).waitFor();
  expect(await seriousFindings(page)).toEqual([]);
});

test("a volume is read, and slices and bone appear", async () => {
  await page.getByLabel("Choose files").setInputFiles(join(planner.folder, FILE));
  await page.locator(".plan-views").waitFor();
  await step("CT");
  await page.getByText("What the file does not say").click();
  await type("Add to values to get HU", "-1024");
  expect((await recipe()).ct).toEqual({ hu_offset: -1024 });
  await step("Anatomy");
  await page.waitForFunction(() => document.querySelectorAll(".plan-views canvas").length >= 4);
  expect(await seriousFindings(page)).toEqual([]);
});

test("a landmark and a plane are set and taken back", async () => {
  await page.getByRole("button", { name: "Place at the crosshair" }).click();
  expect(Object.keys((await recipe()).landmarks.points_mm)).toEqual(["upper_incisor"]);
  await page.getByRole("button", { name: "Set the Occlusal plane" }).click();
  expect((await recipe()).occlusal_plane.normal[2]).toBeGreaterThan(0.9);
  await page.getByRole("button", { name: "Undo" }).click();
  await page.getByRole("button", { name: "Undo" }).click();
  expect(await recipe()).not.toHaveProperty("landmarks");
});

test("the head's position turns the axes of movements", async () => {
  await step("Head position");
  await type("Pitch (chin up)", "10");
  const { head_frame: frame } = await recipe();
  expect(frame.horizontal.normal[1]).toBeCloseTo(Math.sin((10 * Math.PI) / 180), 6);
  await page.getByRole("button", { name: "As the build finds it" }).click();
  expect(await recipe()).not.toHaveProperty("head_frame");
});

test("an operation is added, cut and moved, with a preview of the piece", async () => {
  await step("Operation");
  await page.getByRole("button", { name: "Add", exact: true }).click();
  await type("Forward", "6");
  await page.evaluate(() => (globalThis as any).tissueform.draft.setCrosshair([-100, 36, -86]));
  await page.getByRole("button", { name: "Set planes" }).click();
  await page.getByText(/mandible \d+\.\d cm³/).waitFor();
  const times = await page.locator(".pieces").evaluate((element) => ({ ...(element as HTMLElement).dataset }));
  console.log(`preview of a cut: ${times.workerMs} ms in the worker, ${times.ms} ms with the page's drawing`);
  await page.getByRole("button", { name: "Move Plane 3", exact: true }).click();
  const before = (await recipe()).segments[0].planes[2].point_mm[2];
  await page.getByRole("button", { name: "Shift 1 mm, more" }).click();
  expect((await recipe()).segments[0].planes[2].point_mm[2]).toBeLessThan(before);
  expect(await seriousFindings(page)).toEqual([]);
  await page.getByRole("button", { name: "From the anatomy" }).click();
  expect((await recipe()).segments).toEqual([{ name: "mandible", osteotomy: "bssro", pose: { translation_mm: [0, -6, 0] } }]);
});

test("the recipe is text that can be changed and stays through a reload", async () => {
  await step("Recipe");
  const field = page.getByLabel("Recipe (JSON)");
  // Coarse, so that it is made in seconds and misses a requirement.
  const wanted = { ...(await recipe()), spacing_mm: 2.5, mesh: { edge_mm: 7, fine_edge_mm: 6 } };
  await field.fill('{"format": "tissueform-recipe"}');
  await page.getByRole("button", { name: "Apply the text" }).click();
  await page.getByText('has no "version"').waitFor();
  await field.fill(JSON.stringify(wanted));
  await page.getByRole("button", { name: "Apply the text" }).click();
  expect(await recipe()).toEqual(wanted);
  await page.reload();
  await page.getByRole("heading", { name: "New plan from a CT" }).waitFor();
  expect(await recipe()).toEqual(wanted);
  await page.getByLabel("Choose files").setInputFiles(join(planner.folder, FILE));
  await page.locator(".plan-views").waitFor();
});

test("the plan is built; as it is not ready, it opens after its cautions were read", async () => {
  const stored = await page.evaluate(async () => [JSON.stringify({ ...localStorage }).length, (await indexedDB.databases()).length]);
  expect(stored).toEqual([2, 0]);
  await step("Recipe");
  await saveExport(planner, page, "Download the recipe", "recipe.json");
  await step("Build");
  await page.getByLabel("Title of the case").fill("From a CT");
  await page.getByRole("button", { name: "Build the plan" }).click();
  const open = page.getByRole("button", { name: "Open the planner" });
  await open.waitFor({ timeout: 90_000 });
  expect(await seriousFindings(page)).toEqual([]);
  const read = page.getByLabel("I have read this");
  expect([await open.isDisabled(), await read.isDisabled()]).toEqual([true, true]);
  await page.getByText(/^\d+ cautions?$/).click();
  await read.check();
  const traffic = Buffer.concat(sent);
  // The CT and the recipe are in it, and nothing that names the patient.
  expect(traffic.length).toBeGreaterThan(300_000);
  expect(traffic.includes("tissueform-recipe")).toBe(true);
  for (const text of PLANTED) expect(traffic.includes(text), text).toBe(false);
  await open.click();
  await live(page);
  await typeMove(page, "Forward", "8");
  await moved(page, 3, 12);
});

test("the command line makes the same plan of the same recipe", async () => {
  await page.goto(`${planner.url}/#new`);
  await page.getByRole("heading", { name: "New plan from a CT" }).waitFor();
  await page.getByLabel("Choose files").setInputFiles(join(planner.folder, FILE));
  await page.locator(".plan-views").waitFor();
  await step("Build");
  const ct = await saveExport(planner, page, "Download the CT as it is sent", "ct.nrrd");
  const text = readFileSync(ct).subarray(0, 400).toString("latin1");
  for (const planted of PLANTED) expect(text).not.toContain(planted);
  await page.locator(".cases button", { hasText: "From a CT" }).click();
  await page.getByRole("heading", { name: "Result" }).waitFor();
  const out = join(planner.folder, "by_command");
  execFileSync(join(BIN, "tissueform"), ["plan", "build", "--ct", ct, "--recipe", join(planner.folder, "recipe.json"), "--out", out, "--accept-defects", "--no-pictures"]);
  for (const file of ["plan.json", "head.vtu"]) {
    const built = await saveExport(planner, page, file, file);
    expect(readFileSync(built).equals(readFileSync(join(out, file))), file).toBe(true);
  }
});
