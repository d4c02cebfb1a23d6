// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { BrowserContext, Page } from "playwright-core";
import { IdentityProvider, enterName } from "./identity_provider";
import { Planner, type Hook, live, moved, openPage, seriousFindings, state, takeSegment, typeMove } from "./planner";

let provider: IdentityProvider;
let planner: Planner;

beforeAll(async () => {
  provider = await IdentityProvider.start();
  planner = await Planner.start(undefined, { gateway: provider.gatewayOptions });
  provider.admit(planner.url);
});
afterEach(async () => {
  provider.tokenSeconds = 3600;
  await provider.stop();
  await provider.listen();
});
afterAll(async () => {
  await planner.stop();
  await provider.stop();
});

async function open(context: BrowserContext, path = "/") {
  // The provider's page asks for letters that a machine without the internet has not.
  await context.route("https://fonts.googleapis.com/**", (route) => route.abort());
  const opened = await openPage(context, planner.url + path, [provider.issuer]);
  await opened.page.waitForURL((url) => url.origin === planner.url);
  return opened;
}

async function signIn(page: Page, name: string): Promise<void> {
  await page.getByRole("button", { name: "Sign in", exact: true }).click();
  await enterName(page, name);
  await page.getByText(`Dr. ${name}`).waitFor();
}

/** A planner of `name`'s with the case open. */
async function plannerOf(name: string) {
  const opened = await open(await planner.browse());
  await signIn(opened.page, name);
  await opened.page.setInputFiles("input[type=file]", planner.casePath);
  await live(opened.page);
  return opened;
}

const kept = (page: Page) => page.evaluate(() => JSON.stringify([{ ...localStorage }, { ...sessionStorage }]));

test("who signs in plans under their name, and the token lies in no storage", async () => {
  const { page, faults } = await plannerOf("ada");
  const caseId = /#case=([0-9a-f]{64})$/.exec(page.url())?.[1];
  expect(page.url()).toBe(`${planner.url}/#case=${caseId}`);
  await takeSegment(page, "Lower jaw");
  await typeMove(page, "Forward", "8");
  await moved(page, 6, 10);
  expect(await kept(page)).not.toContain("eyJ");
  expect(await kept(page)).not.toContain("verifier");

  // The provider knows its user still: nothing is asked, and all is as it was.
  const { session } = await state(page);
  await page.waitForFunction(() => (globalThis as unknown as Hook).tissueform.bench.live.isKept);
  await page.reload();
  await live(page);
  await moved(page, 6, 10);
  expect((await state(page)).session).toBe(session);
  expect(page.url()).toBe(`${planner.url}/#case=${caseId}`);
  expect(await seriousFindings(page)).toEqual([]);
  expect(faults).toEqual([]);
});

test("a drag outlives its tokens", async () => {
  provider.tokenSeconds = 4;
  const { page, faults } = await plannerOf("bea");
  let sockets = 0;
  page.on("websocket", () => (sockets += 1));
  const { renewed } = provider;
  await takeSegment(page, "Lower jaw");
  for (let mm = 1; mm <= 4; ++mm) {
    await expect.poll(() => provider.renewed, { timeout: 20_000, interval: 50 }).toBeGreaterThanOrEqual(renewed + mm);
    await typeMove(page, "Forward", String(mm));
    await moved(page, 0.6 * mm, 1.4 * mm);
  }
  expect((await state(page)).connection).toBe("live");
  expect(sockets).toBe(0);
  expect(faults).toEqual([]);
});

test("who signs out is out, here and at the provider", async () => {
  const { page, faults } = await plannerOf("cleo");
  await page.getByRole("button", { name: "Sign out" }).click();
  await page.getByRole("button", { name: /yes/i }).click();
  const button = page.getByRole("button", { name: "Sign in", exact: true });
  await button.waitFor();
  await page.reload();
  await button.waitFor();
  expect(await seriousFindings(page)).toEqual([]);
  await page.keyboard.press("Tab");
  await page.keyboard.press("Enter");
  await enterName(page, "dora");
  await page.getByText("Dr. dora").waitFor();
  expect(faults).toEqual([]);
});

test("an answer that this tab has not asked for lets nobody in", async () => {
  const { page } = await open(await planner.browse(), "/?code=stolen&state=guessed");
  await page.getByRole("alert").getByText("This tab has begun no login").waitFor();
  expect(page.url()).toBe(`${planner.url}/`);
  await signIn(page, "emil");
});

test("an answer with another state lets nobody in", async () => {
  const { page } = await open(await planner.browse());
  await page.getByRole("button", { name: "Sign in", exact: true }).waitFor();
  await page.route(`${provider.issuer}/auth*`, (route) => {
    const asked = new URL(route.request().url()).searchParams;
    return route.fulfill({ status: 302, headers: { location: `${asked.get("redirect_uri")}?code=stolen&state=guessed&iss=${encodeURIComponent(provider.issuer)}` } });
  });
  await page.getByRole("button", { name: "Sign in", exact: true }).click();
  await page.getByRole("alert").getByText("does not belong to this login").waitFor();
  expect(page.url()).toBe(`${planner.url}/`);
});

test("a provider that is down is told, and asked again", async () => {
  await provider.stop();
  const { page } = await open(await planner.browse());
  await page.getByRole("alert").getByText("does not answer. Try again in a moment.").waitFor();
  await provider.listen();
  await signIn(page, "fred");
});

test("a login that ends keeps the work over the next one", async () => {
  provider.tokenSeconds = 4;
  const { page, faults } = await plannerOf("gina");
  await takeSegment(page, "Lower jaw");
  await provider.stop();
  await page.getByRole("alert").getByText("does not answer").waitFor();
  await page.waitForFunction(() => (globalThis as unknown as Hook).tissueform.bench.live.isKept);
  await typeMove(page, "Forward", "7");
  expect(await seriousFindings(page)).toEqual([]);
  provider.tokenSeconds = 3600;
  await provider.listen();
  await page.getByRole("button", { name: "Sign in again" }).click();
  await page.getByText("Dr. gina").waitFor();
  await live(page);
  await moved(page, 5, 9);
  expect((await state(page)).moves[1].forwardMm).toBeCloseTo(7, 9);
  expect(faults).toEqual([]);
});
