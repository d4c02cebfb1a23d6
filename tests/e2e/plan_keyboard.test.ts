// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Page } from "playwright-core";
import { HEAD_RECIPE, writeHead } from "./new_plan";
import { Planner, live, openPage, seriousFindings } from "./planner";

// From a CT to the planner with the keyboard alone, and what axe-core says of each step.

const MOST_STOPS = 200;

let planner: Planner;
let page: Page;
let faults: string[];
beforeAll(async () => {
  planner = await Planner.start();
  ({ page, faults } = await openPage(await planner.browse(), planner.url));
});
afterAll(async () => {
  expect(faults).toEqual([]);
  await planner.stop();
});

const recipe = async () => JSON.parse(await page.evaluate(() => JSON.stringify((globalThis as any).tissueform.draft.recipe)));

/** What has the focus, by the name that a screen reader says. */
function focused(): Promise<string> {
  return page.evaluate(() => {
    const element = document.activeElement as HTMLElement;
    const label = element.getAttribute("aria-label") ?? (element as HTMLInputElement).labels?.[0]?.textContent;
    return (label ?? element.textContent ?? "").trim();
  });
}

/** Tabs on, also from the end to the beginning, until what is called so has the focus. */
async function tabTo(name: string | RegExp): Promise<void> {
  const passed: string[] = [];
  const isIt = (text: string) => (typeof name === "string" ? text === name : name.test(text));
  for (let stop = 0; stop < MOST_STOPS; ++stop) {
    const text = await focused();
    if (isIt(text)) return;
    passed.push(text.slice(0, 30));
    await page.keyboard.press("Tab");
  }
  throw new Error(`the keyboard does not reach ${name}: ${[...new Set(passed)].join(", ")}`);
}

async function press(name: string | RegExp, key = "Enter"): Promise<void> {
  await tabTo(name);
  await page.keyboard.press(key);
}

async function type(name: string, text: string): Promise<void> {
  await tabTo(name);
  await page.keyboard.press("Control+A");
  await page.keyboard.insertText(text);
  await page.keyboard.press("Enter");
}

test("a CT is opened, and its values are explained", async () => {
  await press("New plan from a CT");
  await page.getByRole("heading", { name: "New plan from a CT" }).waitFor();
  expect(await seriousFindings(page)).toEqual([]);
  await tabTo("Choose files");
  const [chooser] = await Promise.all([page.waitForEvent("filechooser"), page.keyboard.press("Enter")]);
  await chooser.setFiles(writeHead(planner.folder));
  await page.locator(".plan-views").waitFor();
  await press("1. CT");
  await press("What the file does not say");
  await type("Add to values to get HU", "-1024");
  expect((await recipe()).ct).toEqual({ hu_offset: -1024 });
  expect(await seriousFindings(page)).toEqual([]);
});

test("landmarks and planes of the anatomy are set and taken back", async () => {
  await press("Next");
  await press("Place at the crosshair");
  await press("Set the Occlusal plane");
  expect(await focused()).toBe("Move the Occlusal plane");
  await page.keyboard.press("Enter");
  expect(await focused()).toBe("Move the Occlusal plane");
  expect(await seriousFindings(page)).toEqual([]);
  await press("Occlusal plane: found by the build");
  await press("Remove Upper incisor");
  expect(await recipe()).toEqual({ format: "tissueform-recipe", version: expect.any(Number), ct: { hu_offset: -1024 }, segments: [] });
});

test("the head is turned", async () => {
  await press("3. Head position");
  await type("Pitch (chin up)", "5");
  expect((await recipe()).head_frame.horizontal.normal[1]).toBeCloseTo(Math.sin((5 * Math.PI) / 180), 6);
  expect(await seriousFindings(page)).toEqual([]);
  await press("As the build finds it");
  expect(await recipe()).not.toHaveProperty("head_frame");
});

test("an operation is chosen, moved and cut, and a cut is shifted several times on end", async () => {
  await press("4. Operation");
  await tabTo("Operation");
  await page.keyboard.press("ArrowDown");
  await press("Add");
  expect((await recipe()).segments[0].osteotomy).toBe("le_fort_1");
  await press("Remove the segment");
  expect(await focused()).toBe("Add");
  await tabTo("Operation");
  await page.keyboard.press("ArrowUp");
  await press("Add");
  await type("Forward", "6");
  await press("Set planes");
  await page.getByText(/mandible \d+\.\d cm³/).waitFor();
  await press("Move Plane 3");
  const height = async () => (await recipe()).segments[0].planes[2].point_mm[2];
  const before = await height();
  await tabTo("Shift 1 mm, more");
  for (let time = 0; time < 3; ++time) await page.keyboard.press("Enter");
  expect(before - (await height())).toBeGreaterThan(2);
  await tabTo("Pitch 2°, less");
  await page.keyboard.press("Enter");
  expect(await focused()).toBe("Pitch 2°, less");
  expect(await seriousFindings(page)).toEqual([]);
  await press("From the anatomy");
  expect((await recipe()).segments).toEqual([{ name: "mandible", osteotomy: "bssro", pose: { translation_mm: [0, -6, 0] } }]);
});

test("the recipe is changed as text", async () => {
  await press("5. Recipe");
  // Coarse, so that it is made in seconds and misses a requirement.
  const wanted = { ...HEAD_RECIPE, spacing_mm: 2.5, mesh: { edge_mm: 7, fine_edge_mm: 6 } };
  await tabTo("Recipe (JSON)");
  await page.keyboard.press("Control+A");
  await page.keyboard.insertText(JSON.stringify(wanted));
  await press("Apply the text");
  expect(await recipe()).toEqual(wanted);
  expect(await seriousFindings(page)).toEqual([]);
});

test("the plan is built, canceled, built again, and opened", async () => {
  await press("6. Build");
  await tabTo("Title of the case");
  await page.keyboard.insertText("By keyboard");
  await press("Build the plan");
  await expect.poll(focused).toBe("Cancel");
  await page.getByRole("status").getByText(/^Building/).waitFor();
  expect(await seriousFindings(page)).toEqual([]);
  await press("Cancel");
  await page.getByText("The build was canceled.", { exact: true }).waitFor();
  await expect.poll(focused).toBe("Build the plan");
  await page.keyboard.press("Enter");
  await page.getByRole("button", { name: "Open the planner" }).waitFor({ timeout: 90_000 });
  expect(await seriousFindings(page)).toEqual([]);
  await press(/^\d+ cautions?$/);
  await press("I have read this", "Space");
  await press("Open the planner");
  await live(page);
});
