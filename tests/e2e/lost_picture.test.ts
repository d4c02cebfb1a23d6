// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { readFileSync } from "node:fs";
import { join } from "node:path";
import { pathToFileURL } from "node:url";
import type { Page } from "playwright-core";
import { type Hook, Planner, moved, openCase, openPage, seriousFindings, state, takeSegment, typeMove } from "./planner";

// The browser may take the graphics card away at any time. What is exported then is the picture or a sentence, never a blank.

const LOST = "The browser lost access to the graphics card";
const LEAST_SHARE = 0.05;

let planner: Planner;
beforeAll(async () => (planner = await Planner.start()));
afterAll(() => planner.stop());

/** The view of the planner's page or of a file that moves. */
const VIEW = "(globalThis.tissueform?.view ?? globalThis.tissueform?.moving?.view)";

const lose = (page: Page) => page.evaluate(`${VIEW}.stage.renderer.getContext().getExtension("WEBGL_lose_context").loseContext()`);
const isLost = (page: Page) => page.evaluate(`${VIEW}.stage.renderer.getContext().isContextLost()`) as Promise<boolean>;
const drawnCount = (page: Page) => page.evaluate(`${VIEW}.stage.drawnCount`) as Promise<number>;

/** The context stays lost; `andNoOther`: the browser gives no other one either. */
function keepLost(page: Page, andNoOther: boolean): Promise<void> {
  return page.evaluate((isAll) => {
    const { tissueform } = globalThis as any;
    const extension = (tissueform.view ?? tissueform.moving.view).stage.renderer.getContext().getExtension("WEBGL_lose_context");
    extension.restoreContext = () => {};
    const { getContext } = HTMLCanvasElement.prototype;
    if (!isAll) return;
    HTMLCanvasElement.prototype.getContext = function (this: HTMLCanvasElement, kind: string, ...rest: unknown[]) {
      return kind.startsWith("webgl") ? null : (getContext as any).call(this, kind, ...rest);
    } as typeof getContext;
  }, andNoOther);
}

/** Of a picture, which part differs from the color at its corner. */
function drawnShare(page: Page, address: string): Promise<number> {
  return page.evaluate(async (from) => {
    const image = new Image();
    image.src = from;
    await image.decode();
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [image.naturalWidth, image.naturalHeight];
    const context = canvas.getContext("2d") as CanvasRenderingContext2D;
    context.drawImage(image, 0, 0);
    // Without the line of text at the bottom.
    const { data } = context.getImageData(0, 0, canvas.width, Math.floor(0.9 * canvas.height));
    let count = 0;
    for (let i = 0; i < data.length; i += 4) count += Math.abs(data[i] - data[0]) + Math.abs(data[i + 2] - data[2]) > 24 ? 1 : 0;
    return (4 * count) / data.length;
  }, address);
}

async function savedPicture(page: Page): Promise<number> {
  const [download] = await Promise.all([page.waitForEvent("download"), page.getByRole("button", { name: "Picture", exact: true }).click()]);
  const path = join(planner.folder, "picture.png");
  await download.saveAs(path);
  return drawnShare(page, `data:image/png;base64,${readFileSync(path).toString("base64")}`);
}

/** Of each figure of the report. */
async function reportShares(page: Page): Promise<number[]> {
  await page.getByRole("button", { name: "Open the report" }).click();
  await page.locator(".report").waitFor();
  const addresses = await page.locator(".report img").evaluateAll((images) => images.map((image) => (image as HTMLImageElement).src));
  const shares = [];
  for (const address of addresses) shares.push(await drawnShare(page, address));
  await page.getByRole("button", { name: "Back to the plan" }).click();
  return shares;
}

async function openPlanner(): Promise<{ page: Page; faults: string[] }> {
  const opened = await openCase(await planner.browse(), planner);
  await opened.page.locator("summary").getByText("Report", { exact: true }).click();
  return opened;
}

describe("a lost picture", () => {
  test.each([["that the browser gives back", false], ["that needs another canvas", true]])("%s comes back by the button", async (_, isKept) => {
    const { page, faults } = await openPlanner();
    if (isKept) await keepLost(page, false);
    await lose(page);
    await page.getByRole("alert").getByText(LOST).waitFor();
    expect(await seriousFindings(page)).toEqual([]);
    const drawn = await drawnCount(page);
    await page.getByRole("button", { name: "Restore picture" }).click();
    await page.getByText(LOST).waitFor({ state: "hidden" });
    await page.getByText("The picture is back.").waitFor();
    await expect.poll(() => drawnCount(page)).toBeGreaterThan(drawn);
    expect(await savedPicture(page)).toBeGreaterThan(LEAST_SHARE);
    // It is turned by the same hand.
    const before = await page.evaluate(() => (globalThis as unknown as Hook).tissueform.view.stage.camera.position.x as number);
    const box = await page.locator(".picture").boundingBox();
    await page.mouse.move((box?.x ?? 0) + 60, (box?.y ?? 0) + 300);
    await page.mouse.down();
    await page.mouse.move((box?.x ?? 0) + 160, (box?.y ?? 0) + 300, { steps: 3 });
    await page.mouse.up();
    expect(await page.evaluate(() => (globalThis as unknown as Hook).tissueform.view.stage.camera.position.x as number)).not.toBe(before);
    expect(faults).toEqual([]);
  });

  test("that does not come back says what to do, and is not drawn meanwhile", async () => {
    const { page } = await openPlanner();
    await keepLost(page, true);
    await lose(page);
    await page.getByRole("button", { name: "Restore picture" }).click();
    await page.getByRole("alert").getByText("reload the page").waitFor();
    const drawn = await drawnCount(page);
    await takeSegment(page, "Lower jaw");
    await typeMove(page, "Forward", "8");
    await moved(page, 6, 10);
    expect(await drawnCount(page)).toBe(drawn);
  });
});

describe("an export from a lost picture", () => {
  test.each([["that the browser gives back", false], ["that needs another canvas", true]])("%s waits for it", async (_, isKept) => {
    const { page, faults } = await openPlanner();
    if (isKept) await keepLost(page, false);
    const whole = await savedPicture(page);
    await lose(page);
    expect(await savedPicture(page)).toBeCloseTo(whole, 2);
    await lose(page);
    const shares = await reportShares(page);
    expect(shares.length).toBe(3);
    for (const share of shares) expect(share).toBeGreaterThan(LEAST_SHARE);
    expect(await isLost(page)).toBe(false);
    expect(faults).toEqual([]);
  });

  test("is refused in a sentence where it does not come back, and other files are not", async () => {
    const { page } = await openPlanner();
    await page.waitForFunction(() => (globalThis as unknown as Hook).tissueform.bench.local.heldColumns !== null);
    await keepLost(page, true);
    await lose(page);
    const names: string[] = [];
    page.on("download", (download) => names.push(download.suggestedFilename()));
    await page.getByRole("button", { name: "Picture", exact: true }).click();
    await page.locator(".notice").getByText("there is no picture: reload the page").waitFor();
    await page.evaluate(() => ((globalThis as unknown as Hook).tissueform.bench.notice.value = ""));
    await page.getByRole("button", { name: "Open the report" }).click();
    await page.locator(".notice").getByText("there is no picture: reload the page").waitFor();
    expect(await page.locator(".report").count()).toBe(0);
    const moves = page.waitForEvent("download");
    await page.getByRole("button", { name: "Moving file" }).click();
    await moves;
    const mesh = page.waitForEvent("download");
    await page.getByRole("button", { name: "Face STL" }).click();
    await mesh;
    expect(names).toEqual(["tissueform-moves.html", "tissueform-face.stl"]);
  });

  test("that is lost while it is drawn draws it again", async () => {
    const { page } = await openPlanner();
    // As the second of the report's three pictures is drawn.
    await page.evaluate(() => {
      const { renderer } = (globalThis as unknown as Hook).tissueform.view.stage;
      const { render } = renderer;
      let count = 0;
      renderer.render = (...words: unknown[]) => {
        render.apply(renderer, words);
        if (renderer.domElement.width === 480 && ++count === 2) renderer.getContext().getExtension("WEBGL_lose_context").loseContext();
      };
    });
    const shares = await reportShares(page);
    expect(shares.length).toBe(3);
    for (const share of shares) expect(share).toBeGreaterThan(LEAST_SHARE);
  });
});

test("a picture that is lost during a drag loses nothing of the drag", async () => {
  const { page, faults } = await openPlanner();
  await takeSegment(page, "Lower jaw");
  await page.getByRole("button", { name: "Front", exact: true }).click();
  const at = await page.evaluate(async () => {
    const { view, bench } = (globalThis as unknown as Hook).tissueform;
    await new Promise<void>((done) => view.stage.invalidate(done));
    const pose = bench.plan.poses()[1];
    const point = view.head.toWorld([0, 1, 2].map((k: number) => pose.pivotMm[k] + pose.translationMm[k])).project(view.stage.camera);
    const box = view.stage.surface.getBoundingClientRect();
    return { x: box.left + ((point.x + 1) / 2) * box.width, y: box.top + ((1 - point.y) / 2) * box.height };
  });
  const left = async () => (await state(page)).moves[1].leftMm;
  await page.mouse.move(at.x + 50, at.y);
  await page.mouse.down();
  await page.mouse.move(at.x + 56, at.y, { steps: 2 });
  const before = await left();
  expect(before).toBeGreaterThan(0);
  await lose(page);
  await page.getByText(LOST).waitFor();
  await page.mouse.move(at.x + 70, at.y, { steps: 4 });
  await expect.poll(left).toBeGreaterThan(before);
  await page.mouse.up();
  const pulled = await left();
  await moved(page, 0.5 * pulled, 1.5 * pulled);
  await page.getByRole("button", { name: "Restore picture" }).click();
  await page.getByText("The picture is back.").waitFor();
  expect(await left()).toBe(pulled);
  expect((await state(page)).connection).toBe("live");
  expect(await savedPicture(page)).toBeGreaterThan(LEAST_SHARE);
  await page.keyboard.press("Control+z");
  expect(await left()).toBe(0);
  expect(faults).toEqual([]);
});

test("who follows, and who has a file that moves, has the same button", async () => {
  const { page } = await openPlanner();
  const link = page.url().replace("#case=", `#follow=${(await state(page)).session.replace("sessions/", "")}&case=`);
  for (const address of [link, pathToFileURL(planner.exportHead(false)).href]) {
    const { page: other } = await openPage(page.context(), address);
    await other.waitForFunction(() => {
      const { tissueform } = globalThis as any;
      return (tissueform?.view ?? tissueform?.moving?.view)?.stage.drawnCount > 0;
    });
    await lose(other);
    await other.getByRole("alert").getByText(LOST).waitFor();
    const drawn = await drawnCount(other);
    await other.getByRole("button", { name: "Restore picture" }).click();
    await other.getByText(LOST).waitFor({ state: "hidden" });
    await expect.poll(() => drawnCount(other)).toBeGreaterThan(drawn);
    await other.close();
  }
});
