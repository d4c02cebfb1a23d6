// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { execFileSync, spawnSync } from "node:child_process";
import { writeFileSync } from "node:fs";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import type { Page } from "playwright-core";
import { BIN, Planner, Program, live, openPage, seriousFindings } from "./planner";

// From the PACS to a case: DCMTK's storescu sends a head to the bridge, whose rule wants drafts. The planner lists the draft, opens
// it with slices and the rule's recipe, and builds; the bridge then knows the case as one of its study.

const SOURCE = fileURLToPath(new URL("../..", import.meta.url));
/** Of an invented patient, in every object that is sent. */
const PLANTED = ["Planted", "Patricia", "PLANTED-4711", "19610203", "Head soft"];
const RECIPE = {
  format: "tissueform-recipe", version: 1, spacing_mm: 2.5, mesh: { edge_mm: 7, fine_edge_mm: 6 },
  segments: [{ name: "mandible", osteotomy: "bssro", pose: { translation_mm: [0, -6, 0] } }],
};
const RULES = { format: "tissueform-series-rules", version: 1, rules: [{ recipe: "recipe.json", draft: true }] };

let planner: Planner;
let bridge: Program;
let page: Page;
let faults: string[];
/** All that the page sent and received. */
const traffic: Buffer[] = [];
let sentBytes = 0;

const state = () => join(planner.folder, "bridge");
const series = (): { key: string; state: string; case: string; last_error: string }[] =>
  JSON.parse(execFileSync(join(BIN, "tissueform-pacs"), ["status", "--json", "--state-dir", state()]).toString()).series;
const drafts = () => page.getByRole("region", { name: "Drafts" });
const recipe = async () => JSON.parse(await page.evaluate(() => JSON.stringify((globalThis as any).tissueform.draft.recipe)));

/** A study of its own. */
function sendStudy(name: string): void {
  const folder = join(planner.folder, name);
  const write = `import sys; sys.path.insert(0, "${SOURCE}/deploy/pacs"); import head_series; head_series.write_series("${folder}", name="Planted^Patricia", patient_id="PLANTED-4711", born="19610203")`;
  execFileSync("/usr/bin/python3", ["-B", "-c", write]);
  const port = bridge.address.split(":")[1];
  execFileSync("storescu", ["-aet", "SCANNER", "-aec", "TISSUEFORM", "+sd", "127.0.0.1", port, folder]);
}

/** The cases page, loaded until it shows so many drafts. */
async function waitForDrafts(count: number): Promise<void> {
  await expect.poll(async () => {
    // A new page: one that only changes what stands behind # reloads itself later.
    await page.goto("about:blank");
    await page.goto(`${planner.url}/`);
    await page.getByRole("button", { name: "New plan from a CT" }).waitFor();
    await page.waitForLoadState("networkidle");
    return drafts().locator("li").count();
  }, { timeout: 90_000 }).toBe(count);
}

beforeAll(async () => {
  const hasPydicom = spawnSync("/usr/bin/python3", ["-c", "import numpy, pydicom"]).status === 0;
  if (!hasPydicom) throw new Error("python3-pydicom is missing: install it");
  planner = await Planner.start();
  writeFileSync(join(planner.folder, "recipe.json"), JSON.stringify(RECIPE));
  writeFileSync(join(planner.folder, "rules.json"), JSON.stringify(RULES));
  const options = ["run", "--state-dir", state(), "--listen", "127.0.0.1:0", "--allow-ae", "SCANNER", "--rules", join(planner.folder, "rules.json"), "--server", planner.serverAddress, "--no-review", "--quiet-seconds", "1"];
  bridge = await Program.start("tissueform-pacs", options);
  const context = await planner.browse();
  context.on("page", (opened) => {
    const send = (bytes: Buffer) => {
      traffic.push(bytes);
      sentBytes += bytes.length;
    };
    opened.on("request", (request) => send(Buffer.concat([Buffer.from(request.url()), request.postDataBuffer() ?? Buffer.alloc(0)])));
    opened.on("response", (response) => void response.body().then((body) => traffic.push(body), () => {}));
    opened.on("websocket", (socket) => {
      socket.on("framesent", ({ payload }) => send(Buffer.from(payload)));
      socket.on("framereceived", ({ payload }) => traffic.push(Buffer.from(payload)));
    });
  });
  ({ page, faults } = await openPage(context, planner.url));
});

afterAll(async () => {
  expect(faults).toEqual([]);
  await bridge.stop("SIGTERM");
  await planner.stop();
});

test("a received study waits among the drafts, on a phone, too", async () => {
  await page.getByRole("button", { name: "New plan from a CT" }).waitFor();
  expect(await drafts().isVisible()).toBe(false);
  sendStudy("first");
  await waitForDrafts(1);
  expect(series().map((entry) => entry.state)).toEqual(["draft"]);
  const key = series()[0].key;
  await drafts().getByText(`Case ${key.slice(0, 8)}`).waitFor();
  await drafts().getByText(/received .*, kept until /).waitFor();
  expect(await seriousFindings(page)).toEqual([]);
  await page.setViewportSize({ width: 375, height: 720 });
  expect(await page.evaluate(() => document.documentElement.scrollWidth)).toBeLessThanOrEqual(375);
  await picture("drafts-phone");
  await page.setViewportSize({ width: 1280, height: 720 });
  await picture("drafts");
});

test("it opens with slices, bone and the rule's recipe, as if it had been dropped", async () => {
  await drafts().locator("li button").first().click();
  await page.locator(".plan-views").waitFor();
  await page.waitForFunction(() => document.querySelectorAll(".plan-views canvas").length >= 4);
  expect((await recipe()).segments).toEqual(RECIPE.segments);
  const { size, range } = await page.evaluate(() => {
    const { source } = (globalThis as any).tissueform.draft;
    return { size: source.grid.size, range: [Math.min(...source.values.subarray(0, 10_000)), source.values.length] };
  });
  expect(size).toEqual([64, 64, 93]);
  expect(range).toEqual([-1024, 64 * 64 * 93]);
  await page.getByRole("navigation", { name: "Steps" }).getByRole("button", { name: "CT" }).click();
  await page.getByText(/received from the PACS/).waitFor();
  expect(await seriousFindings(page)).toEqual([]);
  await picture("draft-open");
});

test("a reload keeps the changed recipe of the draft", async () => {
  await page.evaluate(() => {
    const { draft } = (globalThis as any).tissueform;
    draft.change({ ...draft.recipe, segments: [{ ...draft.recipe.segments[0], pose: { translation_mm: [0, -4, 0] } }] });
  });
  await page.reload();
  await page.locator(".plan-views").waitFor();
  expect((await recipe()).segments[0].pose.translation_mm).toEqual([0, -4, 0]);
});

test("its plan is built on the server without sending the CT back", async () => {
  await page.getByRole("navigation", { name: "Steps" }).getByRole("button", { name: "Build" }).click();
  const before = sentBytes;
  await page.getByRole("button", { name: "Build the plan" }).click();
  const open = page.getByRole("button", { name: "Open the planner" });
  await open.waitFor({ timeout: 90_000 });
  expect(sentBytes - before).toBeLessThan(100_000);
  const read = page.getByLabel("I have read this");
  if (await read.count() > 0) {
    await page.getByText(/^\d+ cautions?$/).click();
    await read.check();
  }
  await open.click();
  await live(page);
});

test("the draft has gone from the list, and its case is one of the study", async () => {
  const built = new URL(page.url()).hash.replace("#case=", "cases/");
  await expect.poll(() => series().map((entry) => [entry.state, entry.case]), { timeout: 30_000 }).toEqual([["published", built]]);
  await waitForDrafts(0);
  expect(await drafts().isVisible()).toBe(false);
});

test("a draft is removed after a question, and the bridge says so", async () => {
  sendStudy("second");
  await waitForDrafts(1);
  await drafts().getByRole("button", { name: /^Remove Case/ }).click();
  await drafts().getByRole("button", { name: /^Keep/ }).click();
  await drafts().getByRole("button", { name: /^Remove Case/ }).press("Enter");
  await page.keyboard.press("Shift+Tab");
  await page.keyboard.press("Enter");
  await drafts().waitFor({ state: "hidden" });
  await expect.poll(() => series().map((entry) => entry.state).sort(), { timeout: 30_000 }).toEqual(["failed", "published"]);
});

test("nothing that the page sent or received names the patient", () => {
  const all = Buffer.concat(traffic);
  expect(all.includes("AnatomicalOrientation")).toBe(true);
  for (const text of PLANTED) expect(all.includes(text), text).toBe(false);
});

/** For a person to look at, where wanted. */
async function picture(name: string): Promise<void> {
  const folder = process.env.TISSUEFORM_E2E_PICTURES;
  if (folder !== undefined) await page.screenshot({ path: join(folder, `${name}.png`), fullPage: true });
}
