// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { join } from "node:path";
import { pathToFileURL } from "node:url";
import type { Page } from "playwright-core";
import { record, writeAnimation } from "./animation";
import { touchDevice } from "./fingers";
import { IdentityProvider, enterName } from "./identity_provider";
import { goToStep, openNewPlan, writeHead } from "./new_plan";
import { type Hook, Planner, live, moved, openCase, openPage, state, takeSegment, typeMove } from "./planner";
import { SlowLine } from "./slow_line";

// The pictures of docs/planner.md, of a case of a whole head:
//
//   TISSUEFORM_CASE=CASE.tfcase TISSUEFORM_PICTURES=FOLDER npm --prefix client/web run pictures

const FOLDER = process.env.TISSUEFORM_PICTURES ?? ".";

let planner: Planner;
beforeAll(async () => (planner = await Planner.start(process.env.TISSUEFORM_CASE)));
afterAll(() => planner.stop());

/** When all is drawn and no notice lies over it. */
async function picture(page: Page, name: string): Promise<void> {
  await page.locator(".notice").waitFor({ state: "hidden" });
  await page.evaluate(() => {
    (document.activeElement as HTMLElement | null)?.blur();
    const { view } = (globalThis as unknown as Hook).tissueform;
    return new Promise<void>((done) => view.stage.invalidate(done));
  });
  await page.waitForTimeout(600);
  await page.screenshot({ path: join(FOLDER, `${name}.jpg`), type: "jpeg", quality: 90 });
}

test("seven pictures", async () => {
  const context = await planner.browse();
  const { page } = await openCase(context, planner);
  await page.emulateMedia({ colorScheme: "dark" });
  await picture(page, "first-sight");

  await takeSegment(page, "Lower jaw");
  await typeMove(page, "Forward", "8");
  await moved(page, 6, 12);
  await page.getByRole("button", { name: "Pre-op ghost" }).click();
  await page.getByRole("button", { name: "Left", exact: true }).click();
  await picture(page, "jaw-8-mm-forward");
  await page.getByRole("button", { name: "Pre-op ghost" }).click();

  await page.getByRole("button", { name: "3/4" }).click();
  await page.getByLabel("Opacity of the skin").fill("0.35");
  await picture(page, "skin-over-bone");
  await page.getByLabel("Opacity of the skin").fill("1");

  await page.getByLabel("Color by").selectOption({ label: "Movement of the skin" });
  await page.getByLabel("Color by").scrollIntoViewIfNeeded();
  await picture(page, "map");
  await page.getByLabel("Color by").selectOption({ label: "Skin color" });

  await page.getByLabel("Name of the prediction").fill("Jaw 8 mm forward");
  await page.locator(".store button").click();
  await page.locator(".predictions li", { hasText: "Jaw 8 mm forward" }).waitFor();
  await typeMove(page, "Pitch", "4");
  await page.getByLabel("Name of the prediction").fill("8 mm forward, chin up");
  await page.locator(".store button").click();
  await page.locator(".predictions li", { hasText: "chin up" }).waitFor();
  await page.getByRole("button", { name: "Compare Jaw 8 mm forward" }).click();
  await page.getByRole("group", { name: "Comparison" }).getByLabel("From", { exact: true }).selectOption({ label: "Pre-op face" });
  await page.getByLabel("Blend between the two").fill("0.6");
  await page.locator(".comparison").scrollIntoViewIfNeeded();
  await picture(page, "comparison");
  await page.getByText("Back to the plan").click();

  await page.getByRole("button", { name: "Send Jaw 8 mm forward to the PACS" }).click();
  await page.getByText("PACS: waiting for the bridge").waitFor();
  await page.locator(".predictions").scrollIntoViewIfNeeded();
  await picture(page, "send-to-pacs");

  const { session } = await state(page);
  const link = page.url().replace("#case=", `#follow=${session.replace("sessions/", "")}&case=`);
  const { page: follower } = await openPage(await planner.browse(), link);
  await follower.emulateMedia({ colorScheme: "light" });
  await moved(follower, 6, 14);
  await follower.getByLabel("Opacity of the skin").fill("0.6");
  await picture(follower, "follower");
  await live(page);
});

test("measures, a target, the band and the bite", async () => {
  const { page } = await openCase(await planner.browse(), planner);
  const open = (title: string) => page.locator("summary").getByText(title, { exact: true }).click();
  const toTop = (title: string) =>
    page.locator(`aside > [aria-label="${title}"]`).evaluate((part) => {
      const panel = part.closest("aside") as HTMLElement;
      panel.scrollTop += part.getBoundingClientRect().top - panel.getBoundingClientRect().top;
    });
  await page.emulateMedia({ colorScheme: "light" });
  await page.setViewportSize({ width: 1280, height: 1430 });
  await page.getByRole("button", { name: "Left", exact: true }).click();
  await takeSegment(page, "Lower jaw");
  await typeMove(page, "Forward", "5");
  await moved(page, 3, 9);
  await page.waitForFunction(() => (globalThis as unknown as Hook).tissueform.bench.localState.value.kind === "ready");
  await typeMove(page, "Forward", "6");
  await moved(page, 4, 9);
  await page.waitForFunction(() => (globalThis as unknown as Hook).tissueform.bench.waitingMs === 0);
  await open("Measures");
  await page.getByRole("button", { name: "Confirm all" }).click();
  await open("Profile");
  await toTop("Measures");
  await picture(page, "measures");
  await open("Profile");
  await page.setViewportSize({ width: 1280, height: 800 });

  await page.getByText("Linear elastic", { exact: true }).click();
  await page.locator("[data-measure=e_line_lower_lip] .band").waitFor();
  await page.locator(".movements").getByText(/, material \d/).first().waitFor();
  await toTop("Movements");
  await picture(page, "movements");
  await page.getByLabel("Color by").selectOption({ label: "95 % interval (material)" });
  await page.locator(".legend").waitFor({ state: "visible" });
  await page.getByRole("button", { name: "3/4" }).click();
  await toTop("Measures");
  await picture(page, "band");
  await page.getByLabel("Color by").selectOption({ label: "Skin color" });
  await open("Measures");

  await page.getByRole("button", { name: "Reset" }).click();
  await page.getByRole("button", { name: "Pre-op ghost" }).click();
  await page.getByRole("button", { name: "Left", exact: true }).click();
  await open("Soft-tissue targets");
  await page.getByLabel("or a place").selectOption({ label: "Chin" });
  const forward = page.getByRole("textbox", { name: "forward", exact: true });
  // The first answer takes what the server prepares for the point; those of a hand that pulls do not.
  const answer = () => page.getByText(/^Searched for/).innerText();
  await forward.fill("5");
  await forward.press("Enter");
  await page.getByText(/Chin: reached/).waitFor();
  const first = await answer();
  // Without a graphics card the page is busy with the picture of the first for longer than with the answer.
  const setDrawing = (isDrawing: boolean) => page.evaluate((on) => (globalThis as unknown as Hook).tissueform.view.stage.setDrawing(on), isDrawing);
  await setDrawing(false);
  await forward.fill("6");
  await forward.press("Enter");
  await expect.poll(answer).not.toBe(first);
  await setDrawing(true);
  await page.getByText(/Chin: reached/).waitFor();
  await moved(page, 4, 10);
  await toTop("Soft-tissue targets");
  await picture(page, "targeted-chin");
  await page.getByRole("button", { name: "Reject", exact: true }).click();
  await open("Soft-tissue targets");
  await page.getByRole("button", { name: "Pre-op ghost" }).click();

  await open("Jaw and occlusion");
  await typeMove(page, "Forward", "6");
  await typeMove(page, "Up", "3");
  await page.getByRole("button", { name: "3/4" }).click();
  await page.getByRole("button", { name: "Show occlusal contacts" }).click();
  await page.getByText(/Contact on about|No contact/).waitFor();
  await page.evaluate(() => (globalThis as unknown as Hook).tissueform.view.stage.zoom(0.75));
  await toTop("Jaw and occlusion");
  await picture(page, "bite");
}, 300_000);

test("three plans side by side", async () => {
  const { page } = await openCase(await planner.browse(), planner);
  await page.emulateMedia({ colorScheme: "light" });
  await page.setViewportSize({ width: 1280, height: 900 });
  await page.getByRole("button", { name: "Left", exact: true }).click();
  await page.locator("summary").getByText("Measures", { exact: true }).click();
  await page.getByRole("button", { name: "Confirm all" }).click();
  await page.getByRole("button", { name: "Side by side" }).click();
  const plans = page.locator(".side-by-side");
  await plans.locator(".segments button", { hasText: "Lower jaw" }).click();
  for (const [plan, mm] of [["B", "4"], ["C", "7"]]) {
    if (plan === "C") await page.getByRole("button", { name: "Add the plan" }).click();
    await page.getByRole("region", { name: `Plan ${plan}` }).getByRole("button").click();
    await typeMove(page, "Forward", mm);
    await page.getByLabel("Name", { exact: true }).fill(`Jaw ${mm} mm forward`);
    await page.getByLabel("Name", { exact: true }).press("Enter");
  }
  await plans.getByLabel("Color by").selectOption({ label: "Movement of the skin" });
  await page.getByText("if surgery and model err as published").first().waitFor();
  await page.locator('[data-row="overjet"], [data-row="largest"]').last().scrollIntoViewIfNeeded();
  await page.waitForTimeout(600);
  await page.screenshot({ path: join(FOLDER, "side-by-side.jpg"), type: "jpeg", quality: 90 });
});

test("the login", async () => {
  const provider = await IdentityProvider.start();
  const house = await Planner.start(process.env.TISSUEFORM_CASE, { gateway: provider.gatewayOptions, server: provider.serverOptions });
  try {
    provider.admit(house.url);
    const page = await (await house.browse()).newPage();
    await page.emulateMedia({ colorScheme: "light" });
    await page.goto(house.url);
    const button = page.getByRole("button", { name: "Sign in", exact: true });
    await button.waitFor();
    await page.screenshot({ path: join(FOLDER, "sign-in.jpg"), type: "jpeg", quality: 90, clip: { x: 0, y: 0, width: 1280, height: 420 } });
    await button.click();
    await enterName(page, "Ada Lovelace");
    await page.getByText("Dr. Ada Lovelace").waitFor();
    await page.setInputFiles("input[type=file]", house.casePath);
    await live(page);
    await takeSegment(page, "Lower jaw");
    await typeMove(page, "Forward", "8");
    await moved(page, 6, 12);
    await page.context().grantPermissions(["clipboard-read", "clipboard-write"], { origin: house.url });
    await page.getByRole("button", { name: "Copy follow link" }).click();
    await page.getByText(/copied, until /).waitFor();
    await picture(page, "signed-in");
  } finally {
    await house.stop();
    await provider.stop();
  }
});

// README's animation, by ImageMagick: convert -delay 12 FOLDER/jaw-*.jpg -resize 800x -layers Optimize -colors 96 jaw.gif
test("the lower jaw goes forward, in frames", async () => {
  const { page } = await openCase(await planner.browse(), planner);
  await page.emulateMedia({ colorScheme: "dark" });
  await takeSegment(page, "Lower jaw");
  await page.getByLabel("Opacity of the skin").fill("0.75");
  const forth = [0, 1, 2, 3, 4, 5, 6, 7, 8, 8, 8];
  for (const [frame, mm] of [...forth, ...forth.slice(1, 8).reverse()].entries()) {
    await typeMove(page, "Forward", String(mm));
    await moved(page, 0.8 * mm, mm + 0.1);
    await picture(page, `jaw-${String(frame).padStart(2, "0")}`);
  }
});

// docs/images/planner/jaw.gif is put together of them by hand: none of our packages makes animations.
test("frames of an animation: the lower jaw 8 mm forward and back", async () => {
  const { page } = await openCase(await planner.browse(), planner);
  await page.emulateMedia({ colorScheme: "dark" });
  await takeSegment(page, "Lower jaw");
  await page.getByLabel("Opacity of the skin").fill("0.55");
  await page.evaluate(() => (globalThis as unknown as Hook).tissueform.bench.gizmo.hide("picture", true));
  const steps = 14;
  for (let step = 0; step <= steps; ++step) {
    const forward = 4 * (1 - Math.cos((Math.PI * step) / steps));
    await typeMove(page, "Forward", forward.toFixed(2));
    await moved(page, 0.6 * forward - 0.05, 1.5 * forward + 0.05);
    await page.evaluate(() => new Promise<void>((done) => (globalThis as unknown as Hook).tissueform.view.stage.invalidate(done)));
    await page.waitForTimeout(150);
    await page.screenshot({ path: join(FOLDER, `drag-${String(step).padStart(2, "0")}.png`), clip: { x: 120, y: 60, width: 1160, height: 540 } });
  }
});

test("a file that moves, opened from disk", async () => {
  const { page } = await openPage(await planner.browse(), pathToFileURL(planner.exportHead(true)).href);
  await page.emulateMedia({ colorScheme: "dark" });
  await page.waitForFunction(() => (globalThis as any).tissueform.moving?.answered > 0);
  await page.getByRole("checkbox").check();
  await page.waitForTimeout(1500);
  await page.screenshot({ path: join(FOLDER, "file-that-moves.jpg"), type: "jpeg", quality: 90 });
});

test.each([["phone", 390, 844], ["tablet", 820, 1180]])("on a %s, the planner and a file that moves", async (name, width, height) => {
  const device = { ...touchDevice(width, height), deviceScaleFactor: 1 };
  const { page } = await openCase(await planner.browse([], device), planner);
  await takeSegment(page, "Lower jaw");
  await typeMove(page, "Forward", "8");
  await moved(page, 6, 12);
  await page.getByLabel("Color by").selectOption({ label: "Movement of the skin" });
  await page.locator("aside").evaluate((panel) => (panel.scrollTop = 0));
  await picture(page, name);
  const { page: moving } = await openPage(await planner.browse([], device), pathToFileURL(planner.exportHead(true)).href);
  await moving.waitForFunction(() => (globalThis as any).tissueform.moving?.answered > 0);
  await moving.waitForTimeout(1500);
  await moving.screenshot({ path: join(FOLDER, `file-that-moves-${name}.jpg`), type: "jpeg", quality: 90 });
});

test("the page's own answer while the server's is 150 ms away", async () => {
  const line = await SlowLine.open(planner.url, 75);
  try {
    const { page } = await openPage(await planner.browse(), line.url);
    await page.setInputFiles("input[type=file]", planner.casePath);
    await live(page);
    await page.waitForFunction(() => (globalThis as unknown as Hook).tissueform.bench.localState.value.kind === "ready");
    await takeSegment(page, "Lower jaw");
    await typeMove(page, "Forward", "5");
    await page.getByText("This page answers at once").scrollIntoViewIfNeeded();
    await page.waitForFunction(() => (globalThis as unknown as Hook).tissueform.bench.waitingMs === 0);
    await picture(page, "own-answer");
  } finally {
    line.close();
  }
});

const STEPS = 30;
/** Without a graphics card there are three pictures a second. */
const FASTER = 3;

test("a drag while every byte is 150 ms late, both ways, as it was seen", async () => {
  const line = await SlowLine.open(planner.url, 150);
  try {
    const { page } = await openPage(await planner.browse(), line.url);
    await page.setViewportSize({ width: 900, height: 520 });
    await page.emulateMedia({ colorScheme: "dark" });
    await page.setInputFiles("input[type=file]", planner.casePath);
    await live(page);
    await page.waitForFunction(() => (globalThis as unknown as Hook).tissueform.bench.localState.value.kind === "ready");
    await takeSegment(page, "Lower jaw");
    await page.getByRole("button", { name: "Left", exact: true }).click();
    await page.getByRole("button", { name: "Pre-op ghost" }).click();
    const slider = page.getByRole("slider", { name: /^Forward/ });
    await slider.scrollIntoViewIfNeeded();
    await page.locator(".notice").waitFor({ state: "hidden" });
    const box = (await slider.boundingBox()) ?? expect.fail("no slider");
    const at = (share: number) => [box.x + (0.5 + share) * box.width, box.y + box.height / 2] as const;
    const frames = await record(page, async () => {
      await page.mouse.move(...at(0));
      await page.mouse.down();
      for (let step = 1; step <= STEPS; ++step) {
        await page.mouse.move(...at(0.14 * (1 - Math.cos((2 * Math.PI * step) / STEPS))));
        await page.waitForTimeout(30);
      }
      await page.mouse.up();
      await page.waitForTimeout(600);
    });
    const seconds = writeAnimation(frames, join(FOLDER, "drag-at-150-ms.webp"), { faster: FASTER });
    console.log(`${frames.length} frames in ${seconds.toFixed(2)} s`);
  } finally {
    line.close();
  }
}, 300_000);

/** What waits for the build stands this long at most. */
const MOST_STANDING_MS = 700;

test("from a CT that is dropped to a face that follows", async () => {
  const { page } = await openNewPlan(await planner.browse(), planner.url);
  await page.setViewportSize({ width: 1100, height: 680 });
  await page.emulateMedia({ colorScheme: "dark" });
  const frames = await record(page, async () => {
    const begin = Date.now();
    await page.getByLabel("Choose files").setInputFiles(writeHead(planner.folder));
    await page.locator(".plan-views").waitFor();
    await goToStep(page, "CT");
    await page.getByText("What the file does not say").click();
    await page.getByRole("textbox", { name: "Add to values to get HU" }).fill("-1024");
    await page.getByRole("textbox", { name: "Add to values to get HU" }).press("Enter");
    await goToStep(page, "Operation");
    await page.waitForTimeout(1500);
    await page.getByRole("button", { name: "Add", exact: true }).click();
    await page.getByRole("textbox", { name: "Forward" }).fill("6");
    await page.getByRole("textbox", { name: "Forward" }).press("Enter");
    await page.waitForTimeout(2500);
    await goToStep(page, "Build");
    await page.getByRole("button", { name: "Build the plan" }).click();
    const open = page.getByRole("button", { name: "Open the planner" });
    await open.waitFor({ timeout: 200_000 });
    const read = page.getByLabel("I have read this");
    if (await read.isVisible()) {
      await page.getByText(/^\d+ cautions?$/).click();
      await page.waitForTimeout(1000);
      await read.check();
    }
    await open.click();
    await live(page);
    console.log(`from the drop to the planner: ${((Date.now() - begin) / 1000).toFixed(1)} s, with 5 s of waiting`);
    await takeSegment(page, "Lower jaw");
    for (let mm = 1; mm <= 8; ++mm) {
      await typeMove(page, "Forward", String(mm));
      await moved(page, 0.5 * mm, 1.5 * mm);
    }
    await page.waitForTimeout(800);
  });
  const seconds = writeAnimation(frames, join(FOLDER, "ct-to-face.webp"), { faster: 2, mostMs: MOST_STANDING_MS });
  console.log(`${frames.length} frames in ${seconds.toFixed(2)} s`);
}, 400_000);
