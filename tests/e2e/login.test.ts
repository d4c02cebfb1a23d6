// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { mkdtempSync, readFileSync, readdirSync, statSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import type { BrowserContext, Page } from "playwright-core";
import { AUDIENCE, IdentityProvider, enterName } from "./identity_provider";
import { Planner, type Hook, live, moved, openPage, seriousFindings, startCommand, state, takeSegment, typeMove } from "./planner";

let provider: IdentityProvider;
let planner: Planner;

beforeAll(async () => {
  provider = await IdentityProvider.start();
  planner = await Planner.start(undefined, { gateway: provider.gatewayOptions, server: provider.serverOptions });
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

async function open(context: BrowserContext, path = "/", at = planner) {
  // The provider's page asks for letters that a machine without the internet has not.
  await context.route("https://fonts.googleapis.com/**", (route) => route.abort());
  const opened = await openPage(context, at.url + path, [provider.issuer]);
  await opened.page.waitForURL((url) => url.origin === at.url);
  return opened;
}

async function signIn(page: Page, name: string): Promise<void> {
  await page.getByRole("button", { name: "Sign in", exact: true }).click();
  await enterName(page, name);
  await page.getByText(`Dr. ${name}`).waitFor();
}

/** A planner of `name`'s with the case open; `before` is done with its page first. */
async function plannerOf(name: string, before: (page: Page) => void = () => {}) {
  const opened = await open(await planner.browse());
  before(opened.page);
  await signIn(opened.page, name);
  await opened.page.setInputFiles("input[type=file]", planner.casePath);
  await live(opened.page);
  return opened;
}

const kept = (page: Page) => page.evaluate(() => JSON.stringify([{ ...localStorage }, { ...sessionStorage }]));

test("a user who signs in plans under their name, and the token is not in any storage", async () => {
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

test("a drag outlives its tokens: it receives every new one, and the server accepts only that", async () => {
  provider.tokenSeconds = 3;
  const tokensSent: number[] = [];
  const { page, faults } = await plannerOf("bea", (early) => {
    early.on("websocket", (socket) => {
      const at = tokensSent.push(0) - 1;
      socket.on("framesent", ({ payload }) => (tokensSent[at] += payload.toString().includes("eyJ") ? 1 : 0));
    });
  });
  const before = tokensSent.length;
  const first = tokensSent[before - 1];
  await takeSegment(page, "Lower jaw");
  for (let mm = 1; mm <= 2; ++mm) {
    await expect.poll(() => tokensSent[before - 1], { timeout: 20_000, interval: 50 }).toBeGreaterThanOrEqual(first + mm);
    await typeMove(page, "Forward", String(mm));
    await moved(page, 0.6 * mm, 1.4 * mm);
  }
  // A token that is not good would have ended the drag; no other one was begun.
  expect((await state(page)).connection).toBe("live");
  expect(tokensSent.length).toBe(before);
  expect(faults).toEqual([]);
});

test("without a token the server answers nobody", async () => {
  const { page } = await open(await planner.browse());
  // Before that the page goes to the provider and back by itself.
  await page.getByRole("button", { name: "Sign in", exact: true }).waitFor();
  const status = await page.evaluate(async () => {
    const headers = { "content-type": "application/grpc-web+proto" };
    const response = await fetch("/tissueform.v1.CaseService/ListCases", { method: "POST", headers, body: new Uint8Array(5) });
    return response.headers.get("grpc-status");
  });
  expect(status).toBe("16");
});

test("a user who signs out is out, here and at the provider", async () => {
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
  await page.getByRole("alert").getByText("No login was started").waitFor();
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

test("a provider that is down is reported, and asked again", async () => {
  await provider.stop();
  const { page } = await open(await planner.browse());
  await page.getByRole("alert").getByText("does not answer. Try again in a moment.").waitFor();
  await provider.listen();
  await signIn(page, "fred");
});

test("a login that ends keeps the work over the next one", async () => {
  provider.tokenSeconds = 3;
  const { page, faults } = await plannerOf("gina");
  await takeSegment(page, "Lower jaw");
  await provider.stop();
  // Not before: a login that only ends soon would renew itself once the provider answers again, and the button would go.
  await page.getByRole("alert").getByText(/^Your login has ended\. .* does not answer/).waitFor();
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

test("the command logs in by a code that is entered in a browser", async () => {
  const folder = mkdtempSync(join(planner.folder, "command-"));
  const file = join(folder, "config/token");
  const command = startCommand(["login", "--issuer", provider.issuer, "--client-id", "command", "--audience", AUDIENCE, "--token-file", file]);
  const url = /or open (\S+)/.exec(await command.said("or open"))?.[1] ?? "";
  const page = await (await planner.browse()).newPage();
  await page.goto(url);
  await page.getByRole("button", { name: "Continue", exact: true }).click();
  await enterName(page, "ida");
  await page.getByText("Sign-in Success").waitFor();
  expect(await command.ended()).toBe(0);
  const token = readFileSync(file, "utf8").trim();
  const claims = () => JSON.parse(Buffer.from(readFileSync(file, "utf8").split(".")[1], "base64url").toString());
  expect(claims()).toMatchObject({ iss: provider.issuer, aud: AUDIENCE, sub: "ida" });
  expect(statSync(file).mode & 0o777).toBe(0o600);
  expect(await command.said("")).not.toContain(token);

  const list = ["case", "list", "--server", planner.serverAddress, "--token-file"];
  expect(await startCommand([...list, file]).ended()).toBe(0);
  const forged = join(folder, "forged");
  writeFileSync(forged, token.replace(/.{8}$/, "AAAAAAAA"), { mode: 0o600 });
  expect(await startCommand([...list, forged]).ended()).toBe(1);

  expect(await startCommand(["login", "--renew", "--token-file", file]).ended()).toBe(0);
  expect(readFileSync(file, "utf8").trim()).not.toBe(token);
  expect(claims().sub).toBe("ida");
  expect(await startCommand(["logout", "--token-file", file]).ended()).toBe(0);
  expect(readdirSync(join(folder, "config"))).toEqual([]);
});

test("a follow link needs no login, shows its end, and is over when its maker ends it", async () => {
  const { page, faults } = await plannerOf("hans");
  await takeSegment(page, "Lower jaw");
  await page.context().grantPermissions(["clipboard-read", "clipboard-write"], { origin: planner.url });
  await page.getByRole("button", { name: "Copy follow link" }).click();
  await page.getByText(/copied, until /).waitFor();
  const url = await page.evaluate(() => navigator.clipboard.readText());
  expect(url).toMatch(/#follow=tfl_[\w-]{43}&case=[0-9a-f]{64}$/);

  const stranger = await planner.browse();
  const { page: follower, faults: theirs } = await openPage(stranger, url);
  await page.getByText("one follows").waitFor();
  await typeMove(page, "Forward", "7");
  await moved(follower, 5, 9);
  await follower.getByText(/Link works until/).waitFor();
  expect(await seriousFindings(follower)).toEqual([]);

  await page.getByRole("button", { name: "End links" }).click();
  await page.getByText("all links were revoked").waitFor();
  await follower.getByText("The link has expired or was revoked.").waitFor();
  const { page: late } = await openPage(stranger, url);
  await late.getByRole("alert").getByText("The link has expired or was revoked.").waitFor();
  expect([...faults, ...theirs]).toEqual([]);
});

test("a server that takes other tokens says which, and the page shows what was found and what is expected", async () => {
  const other = "https://another.example.org";
  const server = provider.serverOptions.map((word) => (word === AUDIENCE ? other : word));
  const strict = await Planner.start(planner.casePath, { gateway: provider.gatewayOptions, server });
  provider.admit(strict.url);
  try {
    const { page } = await open(await strict.browse(), "/", strict);
    await page.getByRole("button", { name: "Sign in", exact: true }).click();
    await enterName(page, "kim");
    await page.getByRole("alert").getByText(`The cases cannot be listed. The token's audience is "${AUDIENCE}", and this server is "${other}"`).waitFor();
  } finally {
    provider.admit(planner.url);
    await strict.stop();
  }
});
