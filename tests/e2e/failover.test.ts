// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import type { Page } from "playwright-core";
import { Front, freeAddress, hasHaproxy } from "./front";
import { Planner, Program, type Hook, live, openCase, openPage, startGateway, state, takeSegment, typeMove } from "./planner";

// Two servers of a cluster behind HAProxy, the one that holds the drag killed or drained; two gateways, the page's own killed.
// PostgreSQL is that of pg_virtualenv:
//
//   pg_virtualenv -t npm --prefix client/web run test:e2e -- failover.test.ts
//
// With TISSUEFORM_PICTURES=FOLDER also pictures of what the page says during the failover and afterwards: moved.jpg, gone-on.jpg.

const { PGHOST, PGPORT, PGUSER, PGPASSWORD, TISSUEFORM_PICTURES } = process.env;
if (PGPORT === undefined) console.log("no PostgreSQL: run this with pg_virtualenv (package postgresql-common)");
if (!hasHaproxy) console.log("no HAProxy: install it (package haproxy)");

const NODES = ["left", "right"];

class Cluster {
  private readonly servers = new Map<string, Program>();
  private front!: Front;
  private readonly folder = mkdtempSync(join(tmpdir(), "tissueform-front-"));
  private readonly places: string[] = [];
  private readonly gateways: Program[] = [];
  planner!: Planner;

  static async start(): Promise<Cluster> {
    const cluster = new Cluster();
    // One after the other: the first makes the tables.
    for (const node of NODES) await cluster.startNode(node);
    cluster.places.push(await freeAddress(), await freeAddress());
    const addresses = new Map([...cluster.servers].map(([node, { address }]) => [node, address]));
    cluster.front = await Front.start(cluster.folder, addresses, cluster.places);
    await cluster.front.has(NODES.length, "servers");
    cluster.planner = await Planner.start(undefined, { calls: cluster.front.calls });
    return cluster;
  }

  /** Where pages come from when their gateway is one of HAProxy's. */
  get url(): string {
    return this.front.url;
  }

  /** One of HAProxy's gateways more, of two. */
  async nextGateway(): Promise<void> {
    this.gateways.push(await startGateway(this.front.calls, this.places[this.gateways.length]));
    await this.front.has(this.gateways.length, "gateways");
  }

  killFirstGateway(): Promise<void> {
    return this.gateways[0].stop("SIGKILL");
  }

  /** At the same address as before. */
  async startNode(node: string): Promise<void> {
    const port = this.servers.get(node)?.address.split(":")[1] ?? "0";
    const store = `postgresql://${PGUSER}@${PGHOST ?? "localhost"}:${PGPORT}/postgres`;
    const options = ["--port", port, "--store", store, "--node-name", node, "--workers", "2", "--drain-seconds", "5"];
    this.servers.set(node, await Program.start("tissueform-server", options, { TISSUEFORM_STORE_PASSWORD: PGPASSWORD ?? "" }));
  }

  async end(node: string, signal: NodeJS.Signals): Promise<void> {
    await this.servers.get(node)?.stop(signal);
  }

  async stop(): Promise<void> {
    await this.front.stop();
    rmSync(this.folder, { recursive: true, force: true });
    for (const gateway of this.gateways) await gateway.stop("SIGKILL");
    await this.planner?.stop();
    for (const server of this.servers.values()) await server.stop("SIGKILL");
  }
}

/** Who holds the page's session, as the page knows it. */
function holder(page: Page): Promise<string> {
  return page.evaluate(() => {
    const { bench } = (globalThis as unknown as Hook).tissueform;
    return bench.live.gateway.routes.nodeOf(bench.live.session.replace("sessions/", ""));
  });
}

/** From now on: how the connection stood, and what notices there were. */
function listen(page: Page): Promise<void> {
  return page.evaluate(() => {
    const { bench } = (globalThis as unknown as Hook).tissueform;
    const heard: string[] = ((globalThis as any).heard = []);
    bench.connection.watch(({ kind }: { kind: string }) => heard.push(kind));
    bench.notice.watch((text: string) => text !== "" && heard.push(text));
  });
}

function heard(page: Page): Promise<string[]> {
  return page.evaluate(() => (globalThis as any).heard);
}

/** Until the server has answered the newest poses and keeps them. */
async function answered(page: Page): Promise<void> {
  await live(page);
  await page.evaluate(() => {
    const { bench } = (globalThis as unknown as Hook).tissueform;
    bench.picture.value = null;
    bench.plan.change(1, { upMm: bench.plan.moves[1].upMm - 0.5 }, true);
  });
  await page.waitForFunction(() => {
    const { bench } = (globalThis as unknown as Hook).tissueform;
    return bench.picture.value !== null && bench.live.isKept;
  });
}

/** Moves the lower jaw; the face's largest movement right after it. */
function drag(page: Page, forwardMm: number): Promise<number> {
  return page.evaluate(async (mm) => {
    const { bench, view } = (globalThis as unknown as Hook).tissueform;
    bench.plan.change(1, { forwardMm: mm }, false);
    // On a machine that is too busy a worker answers, a picture later.
    for (let i = 0; i < 200 && bench.local.posesSinceShown > 0; ++i) await new Promise((done) => setTimeout(done, 5));
    const { shape } = view.head.skins[0];
    let most = 0;
    for (let i = 0; i < shape.positions.length; i += 3) {
      most = Math.max(most, Math.hypot(...[0, 1, 2].map((k) => shape.positions[i + k] - shape.rest[i + k])));
    }
    return most;
  }, forwardMm);
}

/** From now on the lower jaw moves back and forth, and the header's words are written down. */
function moveOn(page: Page): Promise<void> {
  return page.evaluate(() => {
    const { bench } = (globalThis as unknown as Hook).tissueform;
    const words: string[] = ((globalThis as any).words = []);
    new MutationObserver(() => words.push(document.querySelector("header")?.textContent ?? "")).observe(document.body, { subtree: true, childList: true, characterData: true });
    bench.picture.watch(() => ((globalThis as any).pictures = ((globalThis as any).pictures ?? 0) + 1));
    let moves = 0;
    (globalThis as any).hand = setInterval(() => bench.plan.change(1, { forwardMm: 5 + 3 * Math.sin(0.1 * ++moves) }, false), 33);
  });
}

/** So many more pictures of the server's come while the hand moves. */
function goesOn(page: Page, pictures: number): Promise<unknown> {
  return page.evaluate(() => (globalThis as any).pictures).then((before) => page.waitForFunction((least) => (globalThis as any).pictures >= least, before + pictures));
}

/** The hand comes to rest; where the lower jaw is by the page, and by what the server keeps. */
async function comeToRest(page: Page): Promise<{ planned: number[]; kept: number[] }> {
  await page.evaluate(() => {
    const { bench } = (globalThis as unknown as Hook).tissueform;
    clearInterval((globalThis as any).hand);
    bench.plan.change(1, { forwardMm: 7.25 }, true);
  });
  await page.waitForFunction(() => {
    const { bench } = (globalThis as unknown as Hook).tissueform;
    return bench.live.isKept && bench.waitingMs === 0;
  });
  return page.evaluate(async () => {
    const { bench } = (globalThis as unknown as Hook).tissueform;
    const { committedPoses } = await bench.live.gateway.sessions.getSession({ name: bench.live.session });
    const { handle, translationMm } = committedPoses[1];
    const place = bench.plan.handles.findIndex(({ name }: { name: string }) => name === handle);
    return { planned: bench.plan.poses()[place].translationMm, kept: [translationMm.x, translationMm.y, translationMm.z] };
  });
}

async function picture(page: Page, name: string): Promise<void> {
  if (TISSUEFORM_PICTURES === undefined) return;
  await page.screenshot({ path: join(TISSUEFORM_PICTURES, `${name}.jpg`), type: "jpeg", quality: 85 });
}

describe.skipIf(PGPORT === undefined || !hasHaproxy)("a drag in a cluster", () => {
  let cluster: Cluster;
  let opened: Awaited<ReturnType<typeof openCase>>;
  let follower: Awaited<ReturnType<typeof openPage>>;

  beforeAll(async () => {
    cluster = await Cluster.start();
    const context = await cluster.planner.browse();
    opened = await openCase(context, cluster.planner);
    const { page } = opened;
    await takeSegment(page, "Lower jaw");
    await typeMove(page, "Forward", "5");
    await page.waitForFunction(() => (globalThis as unknown as Hook).tissueform.bench.localState.value.kind === "ready");
    const { session } = await state(page);
    const link = page.url().replace("#case=", `#follow=${session.replace("sessions/", "")}&case=`);
    follower = await openPage(context, link);
    await follower.page.getByText("Live", { exact: true }).waitFor();
  });
  afterAll(() => cluster?.stop());
  afterEach(() => expect([...opened.faults, ...follower.faults]).toEqual([]));

  test("continues on the other server when its own is killed, after a short message", async () => {
    const { page } = opened;
    const before = await holder(page);
    expect(NODES).toContain(before);
    await listen(page);
    await cluster.end(before, "SIGKILL");
    await page.getByText("Moving to another server…").waitFor();
    // The page answers the hand by itself, and a follower has its last picture.
    const seen = await drag(page, 8);
    expect((await state(page)).connection).toBe("moving");
    expect(seen).toBeGreaterThan(6);
    await picture(page, "moved");
    expect(await follower.page.evaluate(() => (globalThis as unknown as Hook).tissueform.follower.positions.length)).toBeGreaterThan(0);
    await answered(page);
    await picture(page, "gone-on");
    expect(await holder(page)).toBe(NODES.find((node) => node !== before));
    expect((await heard(page)).filter((text) => text !== "live" && text !== "moving")).toEqual([]);
  });

  test("has its followers with it", async () => {
    const { page } = follower;
    await page.getByText("Live", { exact: true }).waitFor();
    const number = await page.evaluate(() => Number((globalThis as unknown as Hook).tissueform.follower.number));
    await answered(opened.page);
    await page.waitForFunction((old) => Number((globalThis as unknown as Hook).tissueform.follower.number) > old, number);
  });

  test("is handed on by a server that drains, and no click ends in an error", async () => {
    const { page } = opened;
    const before = await holder(page);
    await cluster.startNode(NODES.find((node) => node !== before) ?? "");
    await listen(page);
    const ended = cluster.end(before, "SIGTERM");
    await page.waitForFunction(() => (globalThis as any).heard.includes("moving"));
    const names = await page.evaluate(async () => {
      const { bench } = (globalThis as unknown as Hook).tissueform;
      await bench.stored.store("In the middle of it");
      return bench.stored.all.value.map(({ title }: { title: string }) => title);
    });
    expect(names).toContain("In the middle of it");
    await answered(page);
    await ended;
    expect(await holder(page)).not.toBe(before);
    expect((await heard(page)).filter((text) => text !== "live" && text !== "moving")).toEqual([]);
  });

  test("continues through the other gateway when its own is killed, with the newest pose", async () => {
    await cluster.nextGateway();
    const { page, faults } = await openCase(opened.page.context(), { url: cluster.url, casePath: cluster.planner.casePath });
    await cluster.nextGateway();
    await listen(page);
    await moveOn(page);
    await goesOn(page, 5);
    await cluster.killFirstGateway();
    await page.waitForFunction(() => (globalThis as any).heard.includes("moving"));
    await live(page);
    await goesOn(page, 5);
    const { planned, kept } = await comeToRest(page);
    expect(kept).toEqual(planned.map((mm) => expect.closeTo(mm, 9)));
    const words: string[] = await page.evaluate(() => (globalThis as any).words);
    expect(words.some((word) => word.includes("Moving to another server…"))).toBe(true);
    expect((await heard(page)).filter((text) => text !== "live" && text !== "moving")).toEqual([]);
    expect(faults).toEqual([]);
  });
});
