// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { readFileSync } from "node:fs";
import { join } from "node:path";
import { IdentityProvider, enterName } from "./identity_provider";
import { Nginx, hasNginx } from "./nginx";
import { Planner, type Hook, live, moved, openPage, takeSegment, typeMove } from "./planner";

// The planner below a path of a hospital's proxy: nginx with the configuration of docs/gateway.md, and with that of an
// administrator who has left something out.

const URL_OF_PAGE = "https://hospital.example.org/planner/";
const SOCKET_LINES = { "proxy_set_header Upgrade $http_upgrade;": "", "proxy_set_header Connection $connection_upgrade;": "" };

describe.skipIf(!hasNginx)("a planner below a path", () => {
  let provider: IdentityProvider;
  let planner: Planner;
  const proxies: Nginx[] = [];

  beforeAll(async () => {
    provider = await IdentityProvider.start();
    const names = ["--allow-host", "hospital.example.org", "--trust-forwarded-from", "127.0.0.1"];
    planner = await Planner.start(undefined, { gateway: [...names, ...provider.gatewayOptions], server: provider.serverOptions });
    provider.admit(URL_OF_PAGE.replace(/\/$/, ""));
  });
  afterAll(async () => {
    for (const proxy of proxies) await proxy.stop();
    await planner?.stop();
    await provider?.stop();
  });

  /** The page behind a proxy with these changes of the documented configuration. */
  async function open(changes: Record<string, string> = {}) {
    const proxy = await Nginx.start(join(planner.folder, `nginx${proxies.length}`), new URL(planner.url).host, changes);
    proxies.push(proxy);
    const context = await planner.browse([`--host-resolver-rules=MAP hospital.example.org:443 ${proxy.address}`, "--ignore-certificate-errors"]);
    await context.route("https://fonts.googleapis.com/**", (route) => route.abort());
    return openPage(context, URL_OF_PAGE, [provider.issuer]);
  }

  test("signs in, plans, has followers, writes a file that moves, and comes back after a reload", async () => {
    const { page, faults } = await open();
    await page.getByRole("button", { name: "Sign in", exact: true }).click();
    await enterName(page, "ada");
    await page.getByText("Dr. ada").waitFor();
    await page.setInputFiles("input[type=file]", planner.casePath);
    await live(page);
    expect(page.url()).toMatch(/^https:\/\/hospital\.example\.org\/planner\/#case=[0-9a-f]{64}$/);
    await takeSegment(page, "Lower jaw");
    await typeMove(page, "Forward", "8");
    await moved(page, 6, 10);
    await page.waitForFunction(() => (globalThis as unknown as Hook).tissueform.bench.live.isKept);

    await page.context().grantPermissions(["clipboard-read", "clipboard-write"]);
    await page.getByRole("button", { name: "Copy follow link" }).click();
    await page.getByText("copied, until").waitFor();
    const link = await page.evaluate(() => navigator.clipboard.readText());
    expect(link.startsWith(`${URL_OF_PAGE}#follow=tfl_`)).toBe(true);
    const follower = await openPage(page.context(), link);
    await follower.page.getByText("Live", { exact: true }).waitFor();
    await follower.page.close();

    await page.waitForFunction(() => (globalThis as unknown as Hook).tissueform.bench.local.heldColumns !== null);
    const [file] = await Promise.all([page.waitForEvent("download"), page.getByRole("button", { name: "Moving file" }).click()]);
    expect(readFileSync((await file.path()) ?? "", "utf8")).toContain("<!doctype html>");

    await page.reload();
    await live(page);
    await moved(page, 6, 10);
    expect([...faults, ...follower.faults]).toEqual([]);
  });

  test("says at once that a proxy blocks WebSockets", async () => {
    const { page } = await open(SOCKET_LINES);
    await page.getByRole("button", { name: "Sign in", exact: true }).click();
    await enterName(page, "ada");
    await page.getByText("Dr. ada").waitFor();
    await page.locator(".cases button").first().click();
    await page.locator(".planner header").waitFor();
    await page.getByText("A proxy blocks WebSockets").waitFor({ timeout: 10_000 });
  });

  test("is not a white page where scripts are refused", async () => {
    const { page } = await open({ "proxy_set_header Host $http_host;": "proxy_set_header Host 127.0.0.1;" });
    await page.getByText("its script did not arrive").waitFor();
  });
});
