// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { Planner, type Hook, live, moved, openCase, openPage, seriousFindings, state, takeSegment, typeMove } from "./planner";

let planner: Planner;
beforeAll(async () => (planner = await Planner.start()));
afterAll(() => planner.stop());

describe.each(["light", "dark"] as const)("in %s colours axe-core finds nothing serious", (colorScheme) => {
  test("on the first page and in the planner", async () => {
    const context = await planner.browse();
    const { page } = await openPage(context, planner.url);
    await page.emulateMedia({ colorScheme });
    await page.getByText("Drop a case file here").waitFor();
    expect(await seriousFindings(page)).toEqual([]);
    await page.setInputFiles("input[type=file]", planner.casePath);
    await live(page);
    await takeSegment(page, "Lower jaw");
    await typeMove(page, "Forward", "3");
    await page.getByLabel("Color by").selectOption({ label: "Movement of the skin" });
    await page.locator(".legend").waitFor({ state: "visible" });
    expect(await seriousFindings(page)).toEqual([]);
  });
});

test("everything is done by keys alone", async () => {
  const { page } = await openCase(await planner.browse(), planner);
  const focusOn = async (name: string) => {
    for (let i = 0; i < 80; ++i) {
      await page.keyboard.press("Tab");
      const label = await page.evaluate(() => document.activeElement?.getAttribute("aria-label") ?? document.activeElement?.textContent ?? "");
      if (label.startsWith(name)) return;
    }
    throw new Error(`nothing called ${name} is reached by Tab`);
  };
  await focusOn("3D view of the head");
  await page.keyboard.press("n");
  for (let i = 0; i < 8; ++i) await page.keyboard.press("w");
  await moved(page, 2.5, 5);
  expect((await state(page)).moves[1].forwardMm).toBeCloseTo(4, 9);
  await page.keyboard.press("i");
  await page.keyboard.press("Shift+i");
  expect((await state(page)).moves[1].pitchDeg).toBeCloseTo(0.6, 9);
  const before = await page.evaluate(() => (globalThis as unknown as Hook).tissueform.view.stage.camera.position.x as number);
  await page.keyboard.press("2");
  expect(await page.evaluate(() => (globalThis as unknown as Hook).tissueform.view.stage.camera.position.x as number)).not.toBe(before);
  await page.keyboard.press("?");
  await page.getByRole("dialog").waitFor();
  await page.keyboard.press("Escape");
  await focusOn("Lower jaw");
  await page.keyboard.press("Enter");
  await focusOn("Forward by slider");
  await page.keyboard.press("ArrowRight");
  expect((await state(page)).moves[1].forwardMm).toBeCloseTo(4.1, 9);
  await page.keyboard.press("Tab");
  await page.keyboard.press("ArrowUp");
  expect((await state(page)).moves[1].forwardMm).toBeCloseTo(4.6, 9);
  await focusOn("Store");
  await page.keyboard.press("Enter");
  await page.locator(".predictions strong").waitFor();
});

test("without 3D the numbers work all the same", async () => {
  const { page, faults } = await openCase(await planner.browse(["--disable-3d-apis"]), planner);
  await page.getByText("This browser shows no 3D pictures").waitFor();
  await takeSegment(page, "Lower jaw");
  await typeMove(page, "Forward", "8");
  await moved(page, 6, 10);
  expect(faults).toEqual([]);
});

test("a long drag leaves nothing behind", async () => {
  const { page } = await openCase(await planner.browse(), planner);
  const session = await page.context().newCDPSession(page);
  const heapBytes = async () => {
    await session.send("HeapProfiler.collectGarbage");
    return (await session.send("Runtime.getHeapUsage")).usedSize;
  };
  const drag = (steps: number) =>
    page.evaluate(async (count) => {
      const { bench, view } = (globalThis as unknown as Hook).tissueform;
      view.stage.setDrawing(false);
      for (let step = 0; step < count; ++step) {
        const shown = bench.shown.value;
        bench.plan.change(1, { forwardMm: 5 * Math.sin(step / 20) }, false);
        while (bench.shown.value < shown + 2) await new Promise((done) => setTimeout(done));
      }
    }, steps);
  await drag(100);
  const before = await heapBytes();
  await drag(600);
  // 600 pictures of 5,000 vertices are 36 MB.
  expect((await heapBytes()) - before).toBeLessThan(2e6);
});

test("1280 by 720 shows plan and picture without scrolling sideways", async () => {
  const { page } = await openCase(await planner.browse(), planner);
  const sizes = await page.evaluate(() => ({
    body: document.documentElement.scrollWidth,
    panel: document.querySelector("aside")?.scrollWidth,
    inner: document.querySelector("aside")?.clientWidth,
    picture: document.querySelector(".picture")?.clientHeight ?? 0,
  }));
  expect(sizes.body).toBeLessThanOrEqual(1280);
  expect(sizes.panel).toBeLessThanOrEqual(sizes.inner ?? 0);
  expect(sizes.picture).toBeGreaterThan(500);
});
