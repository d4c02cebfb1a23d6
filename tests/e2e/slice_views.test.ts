// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { BrowserContextOptions, Page } from "playwright-core";
import { Fingers, touchDevice } from "./fingers";
import { seriousFindings } from "./planner";
import { SourcePages } from "./source_pages";

// Slices alone, in Debian's Chromium; client/web/tests/slices/slices_page.ts is the page.

let pages: SourcePages;
beforeAll(async () => (pages = await SourcePages.start()));
afterAll(() => pages.stop());

type Hook = { views: any; reported: any[][] };

async function openSlices(options: BrowserContextOptions = {}): Promise<Page> {
  const page = await pages.open("tests/slices/slices_page.html", { viewport: { width: 1280, height: 800 }, ...options });
  await page.waitForFunction(() => "views" in globalThis);
  return page;
}

/** 81 x 81 x 41 voxels of 2, 2 and 4 mm about the origin, with one bright block at the left, anterior and superior; a point and a plane. */
async function fill(page: Page): Promise<void> {
  await page.evaluate(() => {
    const { views } = globalThis as unknown as Hook;
    const size = [81, 81, 41];
    const values = new Int16Array(size[0] * size[1] * size[2]).fill(-1000);
    for (let k = 27; k < 30; ++k) for (let j = 18; j < 23; ++j) for (let i = 58; i < 63; ++i) values[i + 81 * (j + 81 * k)] = 3000;
    const grid = { size, spacing: [2, 2, 4], origin: [-80, -80, -80], directions: [[1, 0, 0], [0, 1, 0], [0, 0, 1]] };
    views.setVolume({ grid, values, kernel: "" });
    views.setPoints([{ id: "point", label: "Menton", color: "#18b6a4", position: [-30, 20, 0] }]);
    views.setPlanes([{ id: "plane", label: "Cut", color: "#e0559b", point: [0, 40, 0], normal: [0, 1, 0] }, { id: "locked", label: "Midsagittal", color: "#f2c230", point: [0, 0, 0], normal: [1, 0, 0], isLocked: true }]);
    views.setCrosshair([0, 0, 0]);
  });
  await frames(page);
}

const frames = (page: Page) => page.evaluate(() => new Promise<void>((done) => requestAnimationFrame(() => requestAnimationFrame(() => done()))));
const surface = (page: Page, plane: string) => page.locator(`[data-plane=${plane}] .slice-surface`);
const last = (page: Page, kind: string) => page.evaluate((name) => (globalThis as unknown as Hook).reported.filter(([what]) => what === name).at(-1), kind);

/** Where a point of LPS is on the page. */
async function placeOf(page: Page, plane: string, [x, y]: [number, number]): Promise<[number, number]> {
  const box = await surface(page, plane).boundingBox();
  if (box === null) throw new Error(`the ${plane} slice is not shown`);
  // The volume's box is 162 by 162 by 164 mm, and 4 % remain around it.
  const spans: Record<string, [number, number]> = { axial: [162, 162], coronal: [162, 164], sagittal: [162, 164] };
  const pixelMm = 1.04 * Math.max(spans[plane][0] / box.width, spans[plane][1] / box.height);
  return [box.x + box.width / 2 + x / pixelMm, box.y + box.height / 2 + y / pixelMm];
}

test.each(["axial", "coronal", "sagittal"])("left, anterior and superior are where the letters of the %s slice say", async (plane) => {
  const page = await openSlices();
  await fill(page);
  // The block's middle.
  await page.evaluate(() => (globalThis as unknown as Hook).views.setCrosshair([40, -40, 32]));
  await frames(page);
  const found = await surface(page, plane).evaluate((element) => {
    const canvas = element.querySelector("canvas") as HTMLCanvasElement;
    const { data, width, height } = canvas.getContext("2d")?.getImageData(0, 0, canvas.width, canvas.height) as ImageData;
    let [x, y, count] = [0, 0, 0];
    for (let i = 0; i < width * height; ++i) {
      if (data[4 * i] < 200) continue;
      x += (i % width) / width;
      y += Math.floor(i / width) / height;
      ++count;
    }
    const letter = (edge: string) => element.querySelector(`.at-${edge}`)?.textContent;
    return { count, letters: [y / count < 0.5 ? letter("top") : letter("bottom"), x / count < 0.5 ? letter("left") : letter("right")].join("") };
  });
  expect(found.count).toBeGreaterThan(20);
  expect(found.letters).toBe({ axial: "AL", coronal: "SL", sagittal: "SA" }[plane]);
  await page.close();
});

test("everything is done by keys", async () => {
  const page = await openSlices();
  await fill(page);
  const press = async (...keys: string[]) => {
    for (const key of keys) await page.keyboard.press(key);
    await frames(page);
  };
  const position = () => surface(page, "axial").getAttribute("aria-label");
  await surface(page, "axial").focus();
  await press("PageUp");
  expect(await position()).toBe("Axial slice, S 4.0 mm");
  await press("Shift+PageDown");
  expect(await position()).toBe("Axial slice, I 36.0 mm");
  await press("Shift+PageUp", "PageDown");
  await press("ArrowRight", "ArrowDown", "Shift+ArrowDown");
  expect((await last(page, "crosshair"))?.[1]).toEqual([1, expect.closeTo(1.1, 9), 0]);
  await press("3");
  expect(await page.locator(".window-values").textContent()).toBe("center 1300, width 3600");
  await press("[", ".");
  expect(await page.locator(".window-values").textContent()).toBe("center 1464, width 3273");
  await press("n", "ArrowLeft");
  expect(await last(page, "point")).toEqual(["point", "point", [-31, 20, 0], true]);
  await press("n", "ArrowUp", "e");
  const [, id, point, normal] = (await last(page, "plane")) as [string, string, number[], number[]];
  expect([id, ...point]).toEqual(["plane", 0, 41, 0]);
  expect(normal[0]).toBeCloseTo(-Math.sin(Math.PI / 180), 9);
  await press("Escape");
  await page.getByRole("button", { name: "Distance" }).press("Enter");
  await surface(page, "axial").focus();
  await press("Enter", ...Array(12).fill("ArrowRight"), "Enter");
  expect(await page.getByText("Distance 12.0 mm, axial").count()).toBe(1);
  await press("Delete");
  expect(await page.getByText("Distance 12.0 mm, axial").count()).toBe(0);
  await page.getByRole("button", { name: "Angle" }).press("Enter");
  await surface(page, "coronal").focus();
  await press("Enter", ...Array(5).fill("ArrowUp"), "Enter", ...Array(5).fill("ArrowRight"), "Enter");
  expect(await page.getByText("Angle 90.0°, coronal").count()).toBe(1);
  await page.close();
});

test("points, planes, crosshair, slices, window and measurements follow the mouse", async () => {
  const page = await openSlices();
  await fill(page);
  const drag = async (plane: string, from: [number, number], to: [number, number], button: "left" | "right" = "left") => {
    await page.mouse.move(...(await placeOf(page, plane, from)));
    await page.mouse.down({ button });
    await page.mouse.move(...(await placeOf(page, plane, to)), { steps: 4 });
    await page.mouse.up({ button });
    await frames(page);
  };
  await drag("axial", [-30, 20], [-20, 30]);
  const [, , moved, isDone] = (await last(page, "point")) as [string, string, number[], boolean];
  expect(isDone).toBe(true);
  expect(moved.map(Math.round)).toEqual([-20, 30, 0]);
  await drag("axial", [0, 40], [0, 50]);
  expect(((await last(page, "plane")) as any[])[2].map(Math.round)).toEqual([0, 50, 0]);
  // The handle that turns the plane is 70 pixels from its middle.
  const box = await surface(page, "axial").boundingBox();
  const handleMm = (70 * 1.04 * 162) / Math.min(box?.width ?? 1, box?.height ?? 1);
  await drag("axial", [handleMm, 50], [0.8 * handleMm, 50 + 0.6 * handleMm]);
  const turned = ((await last(page, "plane")) as any[])[3] as number[];
  expect([turned[0], turned[1]].map(Math.abs)).toEqual([expect.closeTo(0.6, 1), expect.closeTo(0.8, 1)]);
  // A locked plane stays: the crosshair goes there.
  await page.mouse.click(...(await placeOf(page, "axial", [0, -30])));
  expect(((await last(page, "crosshair")) as any[])[1].map(Math.round)).toEqual([0, -30, 0]);
  await page.mouse.wheel(0, 120);
  await frames(page);
  expect(await surface(page, "axial").getAttribute("aria-label")).toBe("Axial slice, S 4.0 mm");
  await drag("axial", [-60, -60], [-40, -60], "right");
  expect(Number(/width (\d+)/.exec((await page.locator(".window-values").textContent()) ?? "")?.[1])).toBeGreaterThan(1800);
  await page.getByRole("button", { name: "Distance" }).click();
  await drag("sagittal", [-60, 60], [-30, 60]);
  const text = (await page.locator(".slice-measurements li").textContent()) ?? "";
  expect(Number(/Distance ([\d.]+) mm, sagittal/.exec(text)?.[1])).toBeCloseTo(30, 0);
  await page.getByRole("button", { name: "Remove Distance" }).click();
  expect(await page.locator(".slice-measurements li").count()).toBe(0);
  await page.close();
});

test.each(["light", "dark"] as const)("in %s colors axe-core finds nothing serious, also on a phone, which shows one slice at a time", async (colorScheme) => {
  for (const viewport of [{ width: 1280, height: 800 }, { width: 390, height: 844 }]) {
    const page = await openSlices({ viewport, colorScheme, hasTouch: true });
    await fill(page);
    expect(await seriousFindings(page)).toEqual([]);
    const isPhone = viewport.width < 400;
    expect(await page.locator(".slice-surface:visible").count()).toBe(isPhone ? 1 : 3);
    expect(await page.evaluate(() => document.documentElement.scrollWidth)).toBeLessThanOrEqual(viewport.width);
    if (isPhone) {
      await page.getByRole("button", { name: "Sagittal" }).tap();
      await page.touchscreen.tap(...(await placeOf(page, "sagittal", [30, 20])));
      expect(((await last(page, "crosshair")) as any[])[1].map(Math.round)).toEqual([0, 30, -20]);
    }
    await page.close();
  }
});

test("two fingers zoom and pan, one finger moves a point", async () => {
  const page = await openSlices(touchDevice(390, 844));
  await fill(page);
  const [x, y] = await placeOf(page, "axial", [0, 0]);
  const fingers = await Fingers.on(page);
  const [pointX, pointY] = await placeOf(page, "axial", [-30, 20]);
  await fingers.put([pointX + 8, pointY]);
  await fingers.put([pointX + 38, pointY]);
  await fingers.lift();
  await frames(page);
  const box = await surface(page, "axial").boundingBox();
  const pixelMm = (1.04 * 162) / Math.min(box?.width ?? 1, box?.height ?? 1);
  expect(((await last(page, "point")) as any[])[2][0]).toBeCloseTo(-30 + 30 * pixelMm, 0);
  // Twice as far apart, about the middle of the slice: a tap there 20 pixels off is half as far in millimeters.
  // The first finger alone moves the crosshair, which the second takes back.
  await fingers.put([x - 40, y - 60]);
  await fingers.put([x - 40, y - 60], [x + 40, y - 60]);
  expect(((await last(page, "crosshair")) as any[])[1]).toEqual([0, 0, 0]);
  await fingers.put([x - 80, y - 60], [x + 80, y - 60]);
  await fingers.lift();
  await page.touchscreen.tap(x + 20, y + 90);
  await frames(page);
  const [, [left]] = (await last(page, "crosshair")) as any[];
  expect(left).toBeCloseTo(10 * pixelMm, 0);
  await page.close();
});

test("a CT of 512 x 512 x 400 scrolls (printed, not asserted)", async () => {
  const page = await openSlices();
  const figures = await page.evaluate(async () => {
    const { views } = globalThis as unknown as Hook;
    const values = new Int16Array(512 * 512 * 400);
    for (let i = 0; i < values.length; ++i) values[i] = ((i * 7) % 1500) - 1000 + ((i >> 9) % 500);
    views.setVolume({ grid: { size: [512, 512, 400], spacing: [0.45, 0.45, 0.6], origin: [0, 0, 0], directions: [[1, 0, 0], [0, 1, 0], [0, 0, 1]] }, values, kernel: "" });
    const figures: { plane: string; pixels: string; frameMs: number; ownMs: number; label: string }[] = [];
    for (const pane of Array.from(document.querySelectorAll<HTMLElement>(".slice-pane"))) {
      const surface = pane.querySelector<HTMLElement>(".slice-surface") as HTMLElement;
      const began = performance.now();
      let own = 0;
      for (let i = 0; i < 60; ++i) {
        surface.dispatchEvent(new KeyboardEvent("keydown", { key: "PageUp", bubbles: true }));
        // What the slices do in a frame has its turn before this, from the frame's time on.
        await new Promise<void>((done) => requestAnimationFrame((frame) => done(void (own += performance.now() - frame))));
      }
      const { width, height } = surface.querySelector("canvas") as HTMLCanvasElement;
      figures.push({ plane: pane.dataset.plane ?? "", pixels: `${width} x ${height}`, frameMs: (performance.now() - began) / 60, ownMs: own / 60, label: surface.getAttribute("aria-label") ?? "" });
    }
    return figures;
  });
  for (const { plane, pixels, frameMs, ownMs } of figures) console.log(`${plane}: ${pixels} pixels, ${(1000 / frameMs).toFixed(0)} frames per second, ${ownMs.toFixed(1)} ms of a frame are ours`);
  // From the middle, 60 slices of 0.6 or 0.45 mm further.
  expect(figures.map(({ label }) => label)).toEqual(["Axial slice, S 155.7 mm", "Coronal slice, P 142.0 mm", "Sagittal slice, L 142.0 mm"]);
  await page.close();
});
