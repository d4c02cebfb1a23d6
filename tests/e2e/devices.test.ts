// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { pathToFileURL } from "node:url";
import type { BrowserContext, BrowserContextOptions, Page } from "playwright-core";
import { Fingers, type Point, touchDevice } from "./fingers";
import { type Hook, Planner, live, moved, openCase, openPage, seriousFindings, state, takeSegment, typeMove } from "./planner";

// The pages on phones, tablets and screens: nothing lies over anything else, the head is whole, and fingers do what a mouse does.

const DEVICES: [string, BrowserContextOptions][] = [
  ["a small phone", touchDevice(360, 640)],
  ["a phone", touchDevice(390, 844)],
  ["a phone on its side", touchDevice(844, 390)],
  ["a tablet", touchDevice(820, 1180)],
  ["a tablet on its side", touchDevice(1024, 768)],
  ["a laptop", { viewport: { width: 1440, height: 900 } }],
  ["a large screen", { viewport: { width: 2560, height: 1440 } }],
];
const PHONE = touchDevice(390, 844);

let planner: Planner;
let movingUrl: string;
beforeAll(async () => {
  planner = await Planner.start();
  movingUrl = pathToFileURL(planner.exportHead(false)).href;
});
afterAll(() => planner.stop());

/** What is wrong with the layout, one a line. `parts`: selectors of boxes that lie beside each other and within the page. */
function layoutFaults(page: Page, parts: string[]): Promise<string[]> {
  return page.evaluate((selectors) => {
    const faults: string[] = [];
    const { clientWidth, clientHeight, scrollWidth, scrollHeight } = document.documentElement;
    if (scrollWidth > clientWidth || scrollHeight > clientHeight) faults.push(`the page has ${scrollWidth} x ${scrollHeight} in ${clientWidth} x ${clientHeight}`);
    const boxes = selectors.map((name) => ({ name, box: document.querySelector(name)?.getBoundingClientRect() }));
    for (const [i, { name, box }] of boxes.entries()) {
      if (box === undefined || box.width < 1 || box.height < 1) faults.push(`${name} is not visible`);
      if (box === undefined) continue;
      if (box.left < -0.5 || box.top < -0.5 || box.right > clientWidth + 0.5 || box.bottom > clientHeight + 0.5) faults.push(`${name} sticks out of the page`);
      for (const other of boxes.slice(i + 1)) {
        const width = Math.min(box.right, other.box?.right ?? 0) - Math.max(box.left, other.box?.left ?? 0);
        const height = Math.min(box.bottom, other.box?.bottom ?? 0) - Math.max(box.top, other.box?.top ?? 0);
        if (width > 0.5 && height > 0.5) faults.push(`${name} and ${other.name} lie over each other by ${width} x ${height}`);
      }
    }
    const picture = document.querySelector(".picture");
    if (picture !== null && (picture.clientWidth < 240 || picture.clientHeight < 200)) faults.push(`the picture has ${picture.clientWidth} x ${picture.clientHeight}`);
    for (const element of document.querySelectorAll("aside, header, dialog[open]")) {
      if (element.scrollWidth > element.clientWidth) faults.push(`${element.tagName} is wider than its box: ${element.scrollWidth} in ${element.clientWidth}`);
    }
    for (const element of document.querySelectorAll("header button, header .notice-mark, .gizmo-modes button")) {
      const { left, right, bottom, width } = element.getBoundingClientRect();
      if (width > 0 && (left < 0 || right > clientWidth || bottom > clientHeight)) faults.push(`${element.textContent} is cut off`);
    }
    return faults;
  }, parts);
}

const PLANNER_PARTS = ["header", ".picture", ".viewbar", "aside"];

/** From which views the head is cut off, or lost in the picture. */
function viewFaults(page: Page): Promise<string[]> {
  return page.evaluate(async () => {
    const { tissueform } = globalThis as any;
    const view = tissueform.view ?? tissueform.moving.view;
    const faults: string[] = [];
    for (const name of ["front", "left", "right", "threeQuarter", "below"]) {
      view.look(name);
      await new Promise<void>((done) => view.stage.invalidate(done));
      view.stage.camera.updateMatrixWorld();
      let [reachX, reachY] = [0, 0];
      for (const { shape } of view.head.surfaces) {
        for (let i = 0; i < shape.positions.length; i += 3) {
          const point = view.head.toWorld(Array.from(shape.positions.subarray(i, i + 3))).project(view.stage.camera);
          reachX = Math.max(reachX, Math.abs(point.x));
          reachY = Math.max(reachY, Math.abs(point.y));
        }
      }
      const reach = Math.max(reachX, reachY);
      if (reach > 1 || reach < 0.55) faults.push(`from ${name} the head reaches ${reachX.toFixed(2)} x ${reachY.toFixed(2)} of the picture`);
    }
    view.look("threeQuarter");
    return faults;
  });
}

async function openParts(page: Page): Promise<void> {
  for (const summary of await page.locator("aside > details > summary").all()) await summary.click();
}

describe.each(DEVICES)("on %s", (_, device) => {
  let context: BrowserContext;
  beforeEach(async () => void (context = await planner.browse([], device)));
  afterEach(() => context.browser()?.close());

  test("the planner and its panel", async () => {
    const { page, faults } = await openCase(context, planner);
    expect(await layoutFaults(page, PLANNER_PARTS)).toEqual([]);
    expect(await viewFaults(page)).toEqual([]);
    await page.locator("summary").getByText("Measures", { exact: true }).scrollIntoViewIfNeeded();
    await openParts(page);
    await page.getByLabel("Color by").selectOption({ label: "Movement of the skin" });
    await page.locator(".legend").waitFor({ state: "visible" });
    expect(await layoutFaults(page, PLANNER_PARTS)).toEqual([]);
    expect(await seriousFindings(page)).toEqual([]);
    expect(faults).toEqual([]);
  });

  test("the first page, who follows, and the report", async () => {
    const { page } = await openPage(context, planner.url);
    await page.getByText("Drop a case file here").waitFor();
    expect(await page.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth)).toBe(0);
    await page.setInputFiles("input[type=file]", planner.casePath);
    await live(page);
    const link = page.url().replace("#case=", `#follow=${(await state(page)).session.replace("sessions/", "")}&case=`);
    const { page: follower } = await openPage(context, link);
    await follower.waitForFunction(() => (globalThis as unknown as Hook).tissueform.view?.stage.drawnCount > 0);
    expect(await layoutFaults(follower, ["header", ".picture", ".viewbar"])).toEqual([]);
    expect(await viewFaults(follower)).toEqual([]);
    await follower.close();
    await page.locator("summary").getByText("Report", { exact: true }).click();
    await page.getByRole("button", { name: "Open the report" }).click();
    await page.locator(".report").waitFor();
    expect(await page.locator(".report-page").evaluate((sheet) => sheet.scrollWidth - sheet.clientWidth)).toBe(0);
  });
});

test("a phone that is turned shows the same of the head", async () => {
  const { page } = await openCase(await planner.browse([], PHONE), planner);
  const distance = () => page.evaluate(() => (globalThis as unknown as Hook).tissueform.view.stage.camera.position.length() as number);
  const upright = await distance();
  await page.setViewportSize({ width: 844, height: 390 });
  await expect.poll(distance).not.toBeCloseTo(upright, 0);
  expect(await viewFaults(page)).toEqual([]);
  await page.setViewportSize({ width: 390, height: 844 });
  await expect.poll(distance).toBeCloseTo(upright, 3);
});

describe("fingers", () => {
  let page: Page;
  let fingers: Fingers;
  let middle: Point;
  beforeAll(async () => {
    ({ page } = await openCase(await planner.browse([], PHONE), planner));
    fingers = await Fingers.on(page);
    const box = await page.locator(".picture").boundingBox();
    middle = [(box?.x ?? 0) + (box?.width ?? 0) / 2, (box?.y ?? 0) + (box?.height ?? 0) / 2];
  });
  beforeEach(() => page.evaluate(() => (globalThis as unknown as Hook).tissueform.view.look("front")));

  const from = (x: number, y: number): Point => [middle[0] + x, middle[1] + y];
  /** From where the head is looked at: direction, distance, and the point that is looked at. */
  const camera = () =>
    page.evaluate(() => {
      const { camera, controls } = (globalThis as unknown as Hook).tissueform.view.stage;
      const to = camera.position.clone().sub(controls.target);
      const distance = to.length() as number;
      return { direction: to.divideScalar(distance).toArray() as number[], distance, target: controls.target.toArray() as number[] };
    });
  const forward = async () => (await state(page)).moves[1];
  /** Where the middle of the gizmo is. */
  const gizmoAt = (): Promise<Point> =>
    page.evaluate(async () => {
      const { view, bench } = (globalThis as unknown as Hook).tissueform;
      await new Promise<void>((done) => view.stage.invalidate(done));
      const pose = bench.plan.poses()[bench.selected.value];
      const at = view.head.toWorld([0, 1, 2].map((k: number) => pose.pivotMm[k] + pose.translationMm[k])).project(view.stage.camera);
      const box = view.stage.surface.getBoundingClientRect();
      return [box.left + ((at.x + 1) / 2) * box.width, box.top + ((1 - at.y) / 2) * box.height] as const;
    });

  test("one turns the head", async () => {
    const before = await camera();
    await fingers.draw([from(-60, -100)], [from(40, -100)]);
    await fingers.lift();
    const after = await camera();
    expect(Math.abs(after.direction[0])).toBeGreaterThan(0.3);
    expect(after.distance).toBeCloseTo(before.distance, 3);
    expect(after.target).toEqual(before.target);
    expect((await forward()).forwardMm).toBe(0);
  });

  test("two move it", async () => {
    const before = await camera();
    await fingers.draw([from(-60, -100), from(0, -100)], [from(-60, -60), from(0, -60)]);
    await fingers.lift();
    const after = await camera();
    expect(after.target[1] - before.target[1]).toBeGreaterThan(5);
    expect(after.distance / before.distance).toBeCloseTo(1, 1);
    expect(after.direction[2]).toBeCloseTo(1, 3);
  });

  test("two that spread bring it nearer", async () => {
    const before = await camera();
    await fingers.draw([from(-20, -100), from(20, -100)], [from(-60, -100), from(60, -100)]);
    await fingers.lift();
    expect((await camera()).distance).toBeLessThan(0.6 * before.distance);
  });

  test("one takes a segment by a tap, and by a zoom none is taken", async () => {
    const segmentAt = () =>
      page.evaluate(() => {
        const { view } = (globalThis as unknown as Hook).tissueform;
        const at = view.head.toWorld(view.head.segmentMiddle("mandible")).project(view.stage.camera);
        const box = view.stage.surface.getBoundingClientRect();
        // Of the places around the middle the first where the segment is seen.
        for (let r = 0; r < 80; r += 4) {
          for (let a = 0; a < 12; ++a) {
            const [x, y] = [((at.x + 1) / 2) * box.width + r * Math.cos(a), ((1 - at.y) / 2) * box.height + r * Math.sin(a)];
            if (view.segmentAt(x, y) === "mandible" && view.segmentAt(x + 5, y) === "mandible") return [box.left + x, box.top + y] as const;
          }
        }
        throw new Error("no lower jaw is seen");
      });
    const selected = () => page.evaluate(() => (globalThis as unknown as Hook).tissueform.bench.selected.value as number);
    await page.evaluate(() => (globalThis as unknown as Hook).tissueform.bench.gizmo.hide("test", true));
    await takeSegment(page, "Chin");
    const [x, y] = await segmentAt();
    await fingers.put(from(-120, -100));
    await fingers.put(from(-120, -100), [x, y]);
    await fingers.put(from(-140, -110), [x, y]);
    await fingers.lift();
    expect(await selected()).toBe(2);
    await page.evaluate(() => (globalThis as unknown as Hook).tissueform.view.look("front"));
    const [tapX, tapY] = await segmentAt();
    await fingers.put([tapX, tapY]);
    await fingers.put([tapX + 5, tapY]);
    await fingers.lift();
    await expect.poll(selected).toBe(1);
    await page.evaluate(() => (globalThis as unknown as Hook).tissueform.bench.gizmo.hide("test", false));
  });

  test("one pulls the bone by its arm, which a second one and a zoom do not", async () => {
    await takeSegment(page, "Lower jaw");
    const [x, y] = await gizmoAt();
    const scale = await page.evaluate(() => (globalThis as unknown as Hook).tissueform.view.stage.millimetresPerPixel as number);
    await fingers.draw([[x + 45, y]], [[x + 65, y]]);
    const pulled = (await forward()).leftMm;
    expect(pulled).toBeGreaterThan(12 * scale);
    expect(pulled).toBeLessThan(28 * scale);
    // A second finger comes down, moves and goes.
    await fingers.put([x + 65, y], from(0, -120));
    await fingers.put([x + 65, y], from(-80, -120));
    expect((await forward()).leftMm).toBeCloseTo(pulled, 6);
    await fingers.put([x + 65, y]);
    await fingers.put([x + 75, y]);
    expect((await forward()).leftMm).toBeGreaterThan(pulled + 5 * scale);
    await fingers.lift();
    await page.getByRole("button", { name: "Undo", exact: true }).click();
    expect((await forward()).leftMm).toBe(0);

    const before = await camera();
    await fingers.draw([from(-120, -100), [x + 45, y]], [from(-160, -120), [x + 85, y]]);
    await fingers.lift();
    expect((await forward()).leftMm).toBe(0);
    expect((await camera()).distance).toBeLessThan(before.distance);
  });

  test("whose gesture the system takes over let go of the bone", async () => {
    await takeSegment(page, "Lower jaw");
    const [x, y] = await gizmoAt();
    await fingers.draw([[x + 45, y]], [[x + 65, y]]);
    await fingers.cancel();
    expect(await page.evaluate(() => (globalThis as unknown as Hook).tissueform.bench.gizmo.isDragging as boolean)).toBe(false);
    const left = (await forward()).leftMm;
    expect(left).not.toBe(0);
    await fingers.draw([from(-60, -100)], [from(40, -100)]);
    await fingers.lift();
    expect((await forward()).leftMm).toBe(left);
    expect(Math.abs((await camera()).direction[0])).toBeGreaterThan(0.3);
    await page.getByRole("button", { name: "Undo", exact: true }).click();
  });

  test("scroll the panel below the picture, and push its sliders", async () => {
    await takeSegment(page, "Lower jaw");
    const slider = page.getByRole("slider", { name: /^Forward/ });
    await slider.scrollIntoViewIfNeeded();
    const box = await slider.boundingBox();
    const at: Point = [(box?.x ?? 0) + (box?.width ?? 0) / 2, (box?.y ?? 0) + (box?.height ?? 0) / 2];
    await fingers.draw([at], [[at[0] + 30, at[1]]]);
    await fingers.lift();
    expect((await forward()).forwardMm).toBeGreaterThan(1);
    await typeMove(page, "Forward", "8");
    await moved(page, 6, 10);
    const panel = await page.locator("aside").boundingBox();
    const low: Point = [(panel?.x ?? 0) + 12, (panel?.y ?? 0) + (panel?.height ?? 0) - 20];
    const scrolled = () => page.locator("aside").evaluate((aside) => aside.scrollTop);
    const before = await scrolled();
    await fingers.draw([low], [[low[0], low[1] - 200]], 10);
    await fingers.lift();
    await expect.poll(scrolled).toBeGreaterThan(before + 100);
    expect(await layoutFaults(page, PLANNER_PARTS)).toEqual([]);
  });
});

describe.each(DEVICES)("a file that moves on %s", (_, device) => {
  test("shows the face, beside or above its sliders", async () => {
    const context = await planner.browse([], device);
    const { page } = await openPage(context, movingUrl);
    await page.waitForFunction(() => (globalThis as any).tissueform.moving?.answered > 0);
    expect(await layoutFaults(page, ["#notice", ".picture", ".viewbar", "aside"])).toEqual([]);
    expect(await viewFaults(page)).toEqual([]);
    await page.getByRole("checkbox").check();
    await page.locator(".legend").waitFor({ state: "visible" });
    expect(await layoutFaults(page, ["#notice", ".picture", ".viewbar", "aside"])).toEqual([]);
    const drawn = await page.evaluate(async () => {
      const picture = await (globalThis as any).tissueform.moving.view.stage.snapshot();
      const { data } = picture.getContext("2d").getImageData(0, 0, picture.width, picture.height);
      let count = 0;
      for (let i = 3; i < data.length; i += 4) count += data[i] > 200 ? 1 : 0;
      return count / (picture.width * picture.height);
    });
    expect(drawn).toBeGreaterThan(0.12);
    if (device.hasTouch !== true) return void (await context.browser()?.close());
    const box = await page.locator(".picture").boundingBox();
    const [x, y] = [(box?.x ?? 0) + (box?.width ?? 0) / 2, (box?.y ?? 0) + (box?.height ?? 0) / 2];
    const fingers = await Fingers.on(page);
    const turned = () => page.evaluate(() => (globalThis as any).tissueform.moving.view.stage.camera.position.x as number);
    const before = await turned();
    await fingers.draw([[x - 40, y]], [[x + 60, y]]);
    await fingers.lift();
    expect(await turned()).toBeLessThan(before - 50);
    await context.browser()?.close();
  });
});
