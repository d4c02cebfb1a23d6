// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Page } from "playwright-core";
import { touchDevice } from "./fingers";
import { type Hook, Planner, moved, openCase, seriousFindings, state, takeSegment, typeMove } from "./planner";

// Plans side by side: one camera, each plan with its own movements, undo and numbers, which are those of the planner.

let planner: Planner;
beforeAll(async () => (planner = await Planner.start()));
afterAll(() => planner.stop());

async function openPlans(page: Page): Promise<void> {
  await page.getByRole("button", { name: "Side by side" }).click();
  await page.locator(".side-by-side").waitFor();
  await answered(page);
}

/** Every plan has the face of its movements. */
async function answered(page: Page): Promise<void> {
  // What was asked just now is in the table with the next picture.
  await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
  await expect.poll(async () => (await numbers(page, "largest")).includes("…")).toBe(false);
}

/** The numbers of a row: pre-op, then the plans. */
function numbers(page: Page, row: string): Promise<string[]> {
  return page.locator(`.plan-table [data-row="${row}"] td`).evaluateAll((cells) => cells.map((cell) => cell.firstChild?.textContent ?? ""));
}

/** What stands below a plan's number. */
function notes(page: Page, row: string, plan: number): Promise<string[]> {
  return page.locator(`.plan-table [data-row="${row}"] td`).nth(plan + 1).locator("small").allInnerTexts();
}

/** All rows of this kind. */
async function rows(page: Page, kind: string): Promise<Record<string, string[]>> {
  const names = await page.locator(`.plan-table [data-row^="${kind}"]`).evaluateAll((all) => all.map((row) => row.getAttribute("data-row") as string));
  return Object.fromEntries(await Promise.all(names.map(async (name) => [name, await numbers(page, name)] as const)));
}

async function edit(page: Page, letter: string): Promise<void> {
  await page.getByRole("region", { name: `Plan ${letter}` }).getByRole("button").click();
}

async function addPlan(page: Page, source: string): Promise<void> {
  await page.getByLabel("New plan").selectOption({ label: source });
  await page.getByRole("button", { name: "Add the plan" }).click();
  await answered(page);
}

/** The picture of each plan, as it is on the screen, without marks, outline and background, which differ by place. */
async function pictures(page: Page): Promise<Buffer[]> {
  const dress = (isPlain: boolean) =>
    page.evaluate((plain) => {
      document.querySelectorAll<HTMLElement>(".pane .marks").forEach((marks) => (marks.style.visibility = plain ? "hidden" : ""));
      document.querySelectorAll<HTMLElement>(".pane").forEach((pane) => (pane.style.outlineStyle = plain ? "none" : ""));
      document.querySelectorAll<HTMLElement>(".pane button").forEach((name) => (name.style.visibility = plain ? "hidden" : ""));
      (document.querySelector(".panes") as HTMLElement).style.background = plain ? "#888" : "";
      return new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
    }, isPlain);
  await dress(true);
  const shots: Buffer[] = [];
  for (const box of await page.locator(".pane-picture").all()) shots.push(await box.screenshot());
  await dress(false);
  return shots;
}

/** Which part of the pixels of two pictures is clearly different. */
function difference(page: Page, a: Buffer, b: Buffer): Promise<number> {
  return page.evaluate(
    async (both) => {
      const [first, second] = await Promise.all(
        both.map(async (text) => {
          const bitmap = await createImageBitmap(new Blob([Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0))]));
          const canvas = new OffscreenCanvas(Math.min(bitmap.width, 160), Math.min(bitmap.height, 120));
          const context = canvas.getContext("2d") as OffscreenCanvasRenderingContext2D;
          context.drawImage(bitmap, 0, 0, canvas.width, canvas.height);
          return context.getImageData(0, 0, canvas.width, canvas.height).data;
        }),
      );
      if (first.length !== second.length) throw new Error("the pictures have different sizes");
      let count = 0;
      for (let i = 0; i < first.length; i += 4) count += Math.abs(first[i] - second[i]) > 24 ? 1 : 0;
      return count / (first.length / 4);
    },
    [a.toString("base64"), b.toString("base64")],
  );
}

/** The planner's own table of measures: after, and the interval below it. */
function plannerMeasures(page: Page): Promise<Record<string, { after: string; band: string }>> {
  return page.locator(".measures [data-measure]").evaluateAll((all) =>
    Object.fromEntries(
      all
        .filter((row) => row.querySelectorAll("td").length === 3)
        .map((row) => {
          const cell = row.querySelectorAll("td")[1];
          return [row.getAttribute("data-measure"), { after: cell.firstChild?.textContent ?? "", band: cell.querySelector(".band")?.textContent ?? "" }];
        }),
    ),
  );
}

/** Total movements of the planner's table, in its order. */
function plannerMovements(page: Page): Promise<string[]> {
  return page.locator("section[aria-label=Movements] tbody tr").evaluateAll((all) => all.map((row) => (row.querySelectorAll("td")[3].firstChild?.textContent ?? "").replace("·", "0.0")));
}

const wholeIsShown = (page: Page) => page.getByText("Below “after”: where 95 of 100 patients").waitFor();

describe("a whole head", () => {
  let page: Page;
  let faults: string[];
  beforeAll(async () => {
    ({ page, faults } = await openCase(await planner.browse(), planner, planner.packWholeHead()));
    await page.waitForFunction(() => (globalThis as unknown as Hook).tissueform.bench.localState.value.kind === "ready");
  });
  afterEach(() => expect(faults).toEqual([]));

  test("at rest is the same in both views, and nothing has moved", async () => {
    await openPlans(page);
    const still = { ...(await rows(page, "landmark:")), ...(await rows(page, "largest")) };
    expect(Object.keys(still).length).toBeGreaterThan(8);
    for (const [row, cells] of Object.entries(still)) expect(cells, row).toEqual(["0.0", "0.0", "0.0"]);
    expect(await rows(page, "move:")).toEqual({});
    const [a, b] = await pictures(page);
    expect(await difference(page, a, b)).toBeLessThan(0.01);
    const box = await page.locator(".pane-picture").first().boundingBox();
    const [x, y] = [(box?.x ?? 0) + (box?.width ?? 0) / 2, (box?.y ?? 0) + (box?.height ?? 0) / 2];
    await page.mouse.move(x, y);
    await page.mouse.down();
    await page.mouse.move(x - 60, y, { steps: 4 });
    await page.mouse.up();
    await expect.poll(async () => difference(page, a, (await pictures(page))[0])).toBeGreaterThan(0.05);
    const [turnedA, turnedB] = await pictures(page);
    expect(await difference(page, turnedA, turnedB)).toBeLessThan(0.01);
  });

  test("moves in the view of the plan that is edited, which alone undoes it", async () => {
    // From the side a jaw that goes forward shows best.
    await page.locator(".side-by-side").getByRole("button", { name: "Left", exact: true }).click();
    await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
    const before = await pictures(page);
    await edit(page, "B");
    await page.locator(".side-by-side .segments button", { hasText: "Lower jaw" }).click();
    await typeMove(page, "Forward", "8");
    await answered(page);
    await expect.poll(async () => Number((await numbers(page, "largest"))[2])).toBeGreaterThan(5);
    expect((await numbers(page, "largest"))[1]).toBe("0.0");
    expect(await numbers(page, "move:mandible:forwardMm")).toEqual(["0.0", "0.0", "8.0"]);
    // The picture follows the numbers: the view of the plan that is edited changes, then the other's must not have.
    await expect.poll(async () => difference(page, before[1], (await pictures(page))[1])).toBeGreaterThan(0.002);
    expect(await difference(page, before[0], (await pictures(page))[0])).toBeLessThan(0.0005);
    await page.keyboard.press("Control+z");
    await expect.poll(async () => (await numbers(page, "largest"))[2]).toBe("0.0");
    await page.keyboard.press("Control+y");
    await expect.poll(async () => Number((await numbers(page, "largest"))[2])).toBeGreaterThan(5);
    // The planner's plan did not move.
    expect((await state(page)).moves[1].forwardMm).toBe(0);
    await page.getByRole("button", { name: "Back to the planner" }).click();
    await moved(page, 0, 0.05);
  });

  test.each([["this page", null], ["the server", "Stop"]])("has the planner's numbers for the same movements, by answers of %s", async (_, stop) => {
    if (stop === null) await page.getByText("Linear elastic", { exact: true }).click();
    else await page.getByRole("button", { name: stop, exact: true }).click();
    await page.waitForFunction((kind) => (globalThis as unknown as Hook).tissueform.bench.localState.value.kind === kind, stop === null ? "ready" : "stopped");
    await takeSegment(page, "Lower jaw");
    await typeMove(page, "Forward", "5");
    await typeMove(page, "Pitch", "2");
    await moved(page, 3, 9);
    await page.waitForFunction(() => (globalThis as unknown as Hook).tissueform.bench.waitingMs === 0);
    if (stop === null) {
      await page.locator("summary").getByText("Measures", { exact: true }).click();
      await page.getByRole("button", { name: "Confirm all" }).click();
      await wholeIsShown(page);
    }
    const [measures, movements] = [await plannerMeasures(page), await plannerMovements(page)];
    expect(Object.keys(measures).length).toBeGreaterThan(5);
    await openPlans(page);
    await edit(page, "B");
    await page.getByRole("textbox", { name: /^Forward/ }).waitFor();
    await page.locator(".side-by-side").getByRole("button", { name: "Reset", exact: true }).click();
    // The fields follow with the next picture, over what was typed before it.
    await expect.poll(() => page.getByRole("textbox", { name: /^Forward/ }).inputValue()).toBe("0.0");
    await typeMove(page, "Forward", "5");
    await typeMove(page, "Pitch", "2");
    await answered(page);
    const isNear = (text: string, other: string) => Math.abs(Number(text.replace("−", "-")) - Number(other.replace("−", "-"))) < (stop === null ? 1e-9 : 0.11);
    const landmarks = await rows(page, "landmark:");
    expect(Object.keys(landmarks).length).toBe(movements.length);
    Object.values(landmarks).forEach(([, a, b], index) => expect([isNear(a, movements[index]), isNear(b, movements[index])], `${a} ${b} ${movements[index]}`).toEqual([true, true]));
    if (stop === null) for (const plan of [0, 1]) await expect.poll(async () => (await notes(page, "e_line_lower_lip", plan))[0]).toMatch(/\d to .*\d$/);
    for (const [name, { after, band }] of Object.entries(measures)) {
      const [, a, b] = await numbers(page, name);
      expect([isNear(a, after), isNear(b, after)], `${name}: ${a} ${b} ${after}`).toEqual([true, true]);
      if (stop !== null) continue;
      // The planner shows the server's confirmation of the same answer: an end may be rounded the other way.
      const ends = (text: string) => text.replaceAll("−", "-").split(" to ").map(Number);
      for (const plan of [0, 1]) ends((await notes(page, name, plan))[0]).forEach((end, k) => expect(Math.abs(end - ends(band)[k]), `${name} ${k}`).toBeLessThan(0.11));
    }
    await page.getByRole("button", { name: "Back to the planner" }).click();
  });
});

describe("the segments of a head", () => {
  let page: Page;
  let faults: string[];
  const asked: string[] = [];
  beforeAll(async () => {
    const context = await planner.browse();
    // What holds the graphics card: contexts that were made and are not lost.
    await context.addInitScript(() => {
      const contexts: WebGL2RenderingContext[] = [];
      const original = HTMLCanvasElement.prototype.getContext;
      HTMLCanvasElement.prototype.getContext = function (this: HTMLCanvasElement, ...parameters: any[]) {
        const context = (original as any).apply(this, parameters);
        if (context instanceof WebGL2RenderingContext && !contexts.includes(context)) contexts.push(context);
        return context;
      } as any;
      Object.assign(globalThis, { heldContexts: () => contexts.filter((context) => !context.isContextLost()).length, madeContexts: () => contexts.length });
    });
    context.on("request", (request) => asked.push(request.url()));
    ({ page, faults } = await openCase(context, planner));
  });
  afterEach(() => expect(faults).toEqual([]));

  test("are fetched for the comparison when it is opened, and release the graphics card when it is closed", async () => {
    expect(asked.filter((url) => url.includes("side_by_side"))).toEqual([]);
    const held = () => page.evaluate(() => (globalThis as any).heldContexts() as number);
    const before = await held();
    // Browsers take the oldest context away where a page has more than sixteen.
    for (let time = 0; time < 17; ++time) {
      await openPlans(page);
      await page.getByRole("button", { name: "Back to the planner" }).click();
    }
    expect(asked.some((url) => url.includes("side_by_side"))).toBe(true);
    expect(await page.evaluate(() => (globalThis as any).madeContexts() as number)).toBeGreaterThanOrEqual(17);
    expect(await held()).toBe(before);
    expect(await page.evaluate(() => (globalThis as unknown as Hook).tissueform.view.stage.graphics.isLost)).toBe(false);
    expect(await page.evaluate(() => document.activeElement?.textContent)).toBe("Side by side");
  }, 300_000);

  test("are compared as two to four plans, of stored predictions and copies", async () => {
    await takeSegment(page, "Lower jaw");
    await typeMove(page, "Forward", "4");
    await page.getByLabel("Name of the prediction").fill("Jaw 4 mm");
    await page.locator(".store button").click();
    await page.locator(".predictions strong", { hasText: "Jaw 4 mm" }).waitFor();
    await typeMove(page, "Forward", "0");
    await moved(page, 0, 0.05);
    await openPlans(page);
    await addPlan(page, "Prediction “Jaw 4 mm”");
    expect(await numbers(page, "move:mandible:forwardMm")).toEqual(["0.0", "0.0", "0.0", "4.0"]);
    await typeMove(page, "Forward", "6");
    await addPlan(page, "Copy of C: Jaw 4 mm");
    expect(await numbers(page, "move:mandible:forwardMm")).toEqual(["0.0", "0.0", "0.0", "6.0", "6.0"]);
    expect(await page.getByRole("button", { name: "Add the plan" }).isDisabled()).toBe(true);
    // A copy begins there: it has nothing to undo.
    const undo = page.locator(".side-by-side").getByRole("button", { name: "Undo", exact: true });
    expect(await undo.isDisabled()).toBe(true);
    await edit(page, "C");
    await undo.click();
    await expect.poll(() => numbers(page, "move:mandible:forwardMm")).toEqual(["0.0", "0.0", "0.0", "4.0", "6.0"]);
    await edit(page, "B");
    await page.getByRole("button", { name: "Remove", exact: true }).click();
    await expect.poll(() => numbers(page, "move:mandible:forwardMm")).toEqual(["0.0", "0.0", "4.0", "6.0"]);
  });

  test("have one scale of colors in all views, and differences to a plan that is chosen", async () => {
    const legend = page.locator(".side-by-side .legend");
    await page.locator(".side-by-side").getByLabel("Color by").selectOption({ label: "Movement of the skin" });
    await legend.waitFor({ state: "visible" });
    const largest = (await numbers(page, "largest")).map(Number);
    await expect.poll(() => legend.locator("small").innerText()).toMatch(/^largest: A 0\.00, C \d\.\d\d, D \d\.\d\d mm$/);
    const [, , c, d] = largest;
    const shown = (await legend.locator("small").innerText()).match(/[\d.]+/g)?.map(Number) ?? [];
    expect([Math.abs(shown[1] - c) < 0.051, Math.abs(shown[2] - d) < 0.051]).toEqual([true, true]);
    expect(Number(await legend.locator(".ticks span").last().innerText())).toBeGreaterThanOrEqual(d);
    await page.getByLabel("Differences to").selectOption({ label: "C: Jaw 4 mm" });
    await page.locator(".side-by-side").getByLabel("Color by").selectOption({ label: "Difference to the plan chosen above" });
    await expect.poll(() => legend.locator("strong").innerText()).toBe("Difference to C, mm");
    await expect.poll(() => legend.locator("small").innerText()).toMatch(/C 0\.00/);
    // By the answers themselves: the largest distance between the faces of two plans that the server has answered.
    const apart = await page.evaluate(async () => {
      const { bench } = (globalThis as unknown as Hook).tissueform;
      const poses = (mm: number) => {
        const plan = bench.plan.fork();
        plan.change(1, { forwardMm: mm }, true);
        return plan.poses();
      };
      const [four, six] = [await bench.answers.ofModel(bench.live.session, bench.model.value, poses(4)), await bench.answers.ofModel(bench.live.session, bench.model.value, poses(6))];
      const { shape } = bench.view.head.skins[0];
      const lengths = new Float32Array(shape.positions.length / 3);
      shape.spreadLengths(six.map((value: number, i: number) => value - four[i]), lengths);
      return Math.max(...lengths);
    });
    const ofD = Number((await legend.locator("small").innerText()).match(/D ([\d.]+)/)?.[1]);
    expect(Math.abs(ofD - apart)).toBeLessThan(0.05);
    expect(await notes(page, "largest", 2)).toEqual([]);
  });

  test("store a plan under its name, and take one as the planner's in one step", async () => {
    await edit(page, "D");
    await page.getByLabel("Name", { exact: true }).fill("Jaw 6 mm");
    await page.getByLabel("Name", { exact: true }).press("Enter");
    await page.getByRole("columnheader", { name: "D: Jaw 6 mm" }).waitFor();
    await page.locator(".side-by-side").getByRole("button", { name: "Store", exact: true }).click();
    await page.locator(".side-by-side .notice").getByText("Stored “Jaw 6 mm”.").waitFor();
    await page.getByRole("button", { name: "Take this plan" }).click();
    await page.locator(".notice").getByText("Plan D is the planner’s plan now.").waitFor();
    expect((await state(page)).moves[1].forwardMm).toBeCloseTo(6, 6);
    await moved(page, 4, 7);
    await page.locator(".predictions strong", { hasText: "Jaw 6 mm" }).waitFor();
    const stored = await page.evaluate(() => (globalThis as unknown as Hook).tissueform.bench.stored.all.value[0].poses.find(({ handle }: any) => handle === "mandible").translationMm);
    expect(Math.hypot(stored.x, stored.y, stored.z)).toBeCloseTo(6, 4);
    await page.getByRole("button", { name: "Undo", exact: true }).click();
    await moved(page, 0, 0.05);
    expect((await state(page)).moves[1].forwardMm).toBe(0);
  });
});

describe.each(["light", "dark"] as const)("in %s colors", (colorScheme) => {
  test("axe-core finds nothing serious, and every step is done by keys", async () => {
    const { page } = await openCase(await planner.browse(), planner);
    await page.emulateMedia({ colorScheme });
    const focusOn = async (name: string) => {
      for (let i = 0; i < 80; ++i) {
        const label = await page.evaluate(() => document.activeElement?.getAttribute("aria-label") ?? document.activeElement?.textContent ?? "");
        if (label.startsWith(name)) return;
        await page.keyboard.press("Tab");
      }
      throw new Error(`nothing called ${name} is reached by Tab`);
    };
    await page.locator(".viewbar button").first().focus();
    await focusOn("Side by side");
    await page.keyboard.press("Enter");
    await answered(page);
    expect(await page.evaluate(() => document.activeElement?.textContent)).toBe("Back to the planner");
    await focusOn("B: ");
    await page.keyboard.press("Enter");
    await focusOn("3D views of the plans");
    const before = await pictures(page);
    await page.keyboard.press("2");
    await expect.poll(async () => difference(page, before[0], (await pictures(page))[0])).toBeGreaterThan(0.05);
    await focusOn("Numbers of the plans");
    await focusOn("Add the plan");
    await page.keyboard.press("Enter");
    await page.getByRole("region", { name: "Plan C" }).waitFor();
    await focusOn("Lower jaw");
    await page.keyboard.press("Enter");
    await focusOn("Forward by slider");
    await page.keyboard.press("Tab");
    for (let i = 0; i < 6; ++i) await page.keyboard.press("ArrowUp");
    // B is what an earlier test stored, or a copy of A.
    await expect.poll(async () => (await numbers(page, "move:mandible:forwardMm")).filter((_, column) => column !== 2)).toEqual(["0.0", "0.0", "3.0"]);
    await page.locator(".side-by-side").getByLabel("Color by").selectOption({ label: "Movement of the skin" });
    await answered(page);
    await page.locator(".side-by-side .notice").waitFor({ state: "hidden" });
    expect(await seriousFindings(page)).toEqual([]);
  });
});

test.each([["a phone", touchDevice(375, 812)], ["a phone on its side", touchDevice(812, 375)], ["a tablet", touchDevice(820, 1180)], ["a tablet on its side", touchDevice(1180, 820)]])("four plans fit on %s", async (_, device) => {
  const context = await planner.browse([], device);
  const { page } = await openCase(context, planner);
  await openPlans(page);
  await addPlan(page, "The case’s plan");
  await addPlan(page, "Pre-op");
  const faults = await page.evaluate(() => {
    const { clientWidth, clientHeight, scrollWidth, scrollHeight } = document.documentElement;
    const found: string[] = [];
    if (scrollWidth > clientWidth || scrollHeight > clientHeight) found.push(`the page has ${scrollWidth} x ${scrollHeight} in ${clientWidth} x ${clientHeight}`);
    const boxes = Array.from(document.querySelectorAll(".pane-picture"), (box) => box.getBoundingClientRect());
    if (boxes.length !== 4) found.push(`${boxes.length} pictures`);
    if (new Set(boxes.map(({ width, height }) => `${Math.round(width)} x ${Math.round(height)}`)).size > 1) found.push("pictures of different sizes");
    for (const { width, height, right } of boxes) if (width < 100 || height < 80 || right > clientWidth) found.push(`a picture of ${width} x ${height}`);
    const page = document.querySelector(".side-by-side") as HTMLElement;
    if (page.scrollWidth > page.clientWidth) found.push(`the comparison is wider than its box: ${page.scrollWidth} in ${page.clientWidth}`);
    const aside = page.querySelector("aside") as HTMLElement;
    if (aside.scrollWidth > aside.clientWidth) found.push(`the fields are wider than their box: ${aside.scrollWidth} in ${aside.clientWidth}`);
    return found;
  });
  expect(faults).toEqual([]);
  // The planner's plan is at rest, and so is the last one: but for parts of a pixel, they look alike.
  const shown = await pictures(page);
  expect(await difference(page, shown[0], shown[3])).toBeLessThan(0.04);
  await context.browser()?.close();
});

test("without 3D the numbers are compared", async () => {
  const { page, faults } = await openCase(await planner.browse(["--disable-3d-apis"]), planner);
  await openPlans(page);
  await edit(page, "B");
  await page.locator(".side-by-side .segments button", { hasText: "Lower jaw" }).click();
  await typeMove(page, "Forward", "8");
  await expect.poll(async () => Number((await numbers(page, "largest"))[2])).toBeGreaterThan(5);
  expect(faults).toEqual([]);
});
