// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type ChildProcess, execFileSync, spawn } from "node:child_process";
import { chmodSync, cpSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { type Browser, type BrowserContext, type BrowserContextOptions, type Page, chromium } from "playwright-core";

// Everything as a user has it: server, gateway and planner as they were built, Debian's Chromium, loopback.

const SOURCE = fileURLToPath(new URL("../..", import.meta.url));
export const BIN = join(process.env.TISSUEFORM_BUILD_DIR ?? join(SOURCE, "build/release"), "bin");
const WEB = process.env.TISSUEFORM_WEB_DIR ?? join(SOURCE, "build/web");
export const CHROMIUM = process.env.TISSUEFORM_CHROMIUM ?? "/usr/bin/chromium";
const START_MS = 20_000;

/** What the page's test hook holds; see client/web/src/main.ts. */
export type Hook = { tissueform: { bench: any; follower: any; view: any } };

/** A program that prints "listening on ADDRESS", or "receiving on", when it is ready. */
export class Program {
  private constructor(
    private readonly child: ChildProcess,
    readonly address: string,
  ) {}

  /** `variables`: of its environment, beside those of this process. */
  static start(name: string, options: string[], variables: Record<string, string> = {}): Promise<Program> {
    const child = spawn(join(BIN, name), options, { stdio: ["ignore", "pipe", "pipe"], env: { ...process.env, ...variables } });
    return new Promise((accept, reject) => {
      let out = "";
      let errors = "";
      const timer = setTimeout(() => reject(new Error(`${name} is not ready: ${errors}`)), START_MS);
      child.stderr?.on("data", (chunk: Buffer) => (errors = (errors + chunk.toString()).slice(-4000)));
      child.stdout?.on("data", (chunk: Buffer) => {
        out += chunk.toString();
        const match = /(?:listening|receiving) on (\S+)/.exec(out);
        if (match === null) return;
        clearTimeout(timer);
        accept(new Program(child, match[1]));
      });
      child.once("error", reject);
      child.once("exit", () => reject(new Error(`${name} has ended: ${errors}`)));
    });
  }

  async stop(signal: NodeJS.Signals): Promise<void> {
    if (this.child.exitCode !== null || this.child.signalCode !== null) return;
    const ended = new Promise((accept) => this.child.once("exit", accept));
    this.child.kill(signal);
    await ended;
  }

  /** Begins to drain; returns at once. */
  terminate(): void {
    this.child.kill("SIGTERM");
  }
}

/** The command `tissueform`: `said` resolves with all it has printed, once `text` is in that; `ended` with its exit code. */
export function startCommand(options: string[]): { said(text: string): Promise<string>; ended(): Promise<number | null> } {
  const child = spawn(join(BIN, "tissueform"), options, { stdio: ["ignore", "pipe", "inherit"] });
  let out = "";
  const ended = new Promise<number | null>((accept) => child.once("close", accept));
  const said = (text: string) =>
    new Promise<string>((accept, reject) => {
      const look = () => out.includes(text) && accept(out);
      child.stdout.on("data", look);
      void ended.then(() => (out.includes(text) ? accept(out) : reject(new Error(`the command has ended and said only: ${out}`))));
      look();
    });
  child.stdout.on("data", (chunk: Buffer) => (out += chunk.toString()));
  return { said, ended: () => ended };
}

/** A gateway with the planner before this server, or HAProxy. */
export function startGateway(server: string, listen: string, options: string[] = []): Promise<Program> {
  return Program.start("tissueform-gateway", ["--server", server, "--listen", listen, "--web", WEB, "--drain-seconds", "1", ...options]);
}

/** Server and gateway with a case of the bundled head, and a browser. */
export class Planner {
  readonly folder = mkdtempSync(join(tmpdir(), "tissueform-e2e-"));
  casePath = join(this.folder, "head.tfcase");
  private server: Program | null = null;
  private gateway: Program | null = null;
  private readonly browsers: Browser[] = [];

  private constructor(private readonly serverOptions: string[]) {}

  /**
   * `casePath`: of a case; left out: one of the bundled head with three segments, without the surfaces that surround it.
   * `options`: more of the programs; `calls`: where the gateway sends calls, in place of a server of its own.
   */
  static async start(casePath?: string, options: { gateway?: string[]; server?: string[]; calls?: string } = {}): Promise<Planner> {
    const planner = new Planner(options.server ?? []);
    chmodSync(planner.folder, 0o700);
    if (casePath !== undefined) planner.casePath = casePath;
    else execFileSync(join(BIN, "tissueform"), ["case", "pack", planner.writePlan(false), "--out", planner.casePath]);
    if (options.calls === undefined) await planner.startServer();
    planner.gateway = await startGateway(options.calls ?? planner.serverAddress, "127.0.0.1:0", options.gateway);
    return planner;
  }

  /** A case of the whole head: skin, skull, teeth and landmarks beside the segments. A browser without a graphics card is slow with it. */
  packWholeHead(): string {
    const path = join(this.folder, "whole.tfcase");
    execFileSync(join(BIN, "tissueform"), ["case", "pack", this.writePlan(true), "--out", path]);
    return path;
  }

  /** The same as a file that moves; or without what surrounds the segments. */
  exportHead(isWhole: boolean): string {
    const path = join(this.folder, isWhole ? "moves.html" : "segments-move.html");
    execFileSync(join(BIN, "tissueform"), ["export", this.writePlan(isWhole), "--html", path, "--model", "linear_elastic", "--overwrite"]);
    return path;
  }

  /** The bundled head with three segments, whose stiffness is known within a range; `isWhole`: and what surrounds it. */
  private writePlan(isWhole: boolean): string {
    const folder = join(this.folder, isWhole ? "whole" : "plan");
    const filter = (path: string) => isWhole || !path.endsWith("viewer.glb");
    cpSync(join(SOURCE, "tests/data/plans/three_segments"), folder, { recursive: true, filter });
    const path = join(folder, "plan.json");
    const uncertainty = { youngs_modulus_factor_95: 2, poisson_ratio_95: [0.4, 0.48] };
    writeFileSync(path, JSON.stringify({ ...JSON.parse(readFileSync(path, "utf8")), version: 2, uncertainty }));
    return path;
  }

  serverAddress = "127.0.0.1:0";

  /** At the same address as before, with what it had kept. */
  async startServer(): Promise<void> {
    const port = this.serverAddress.split(":")[1];
    const data = join(this.folder, "data");
    const options = ["--port", port, "--data-dir", data, "--workers", "2", "--drain-seconds", "6", ...this.serverOptions];
    this.server = await Program.start("tissueform-server", options);
    this.serverAddress = this.server.address;
  }

  async killServer(): Promise<void> {
    await this.server?.stop("SIGKILL");
  }

  drainServer(): void {
    this.server?.terminate();
  }

  async drained(): Promise<void> {
    await this.server?.stop("SIGTERM");
  }

  get url(): string {
    return this.gateway?.address ?? "";
  }

  /** A browser of its own: what it keeps is its own, too. `device`: what it looks like to the page. */
  async browse(flags: string[] = [], device: BrowserContextOptions = {}): Promise<BrowserContext> {
    const args = ["--no-sandbox", "--enable-unsafe-swiftshader", "--disable-dev-shm-usage", ...flags];
    const browser = await chromium.launch({ executablePath: CHROMIUM, args });
    this.browsers.push(browser);
    const context = await browser.newContext({ viewport: { width: 1280, height: 720 }, acceptDownloads: true, ...device });
    context.setDefaultTimeout(60_000);
    return context;
  }

  async stop(): Promise<void> {
    await Promise.all(this.browsers.map((browser) => browser.close()));
    await this.gateway?.stop("SIGTERM");
    await this.server?.stop("SIGKILL");
    rmSync(this.folder, { recursive: true, force: true });
  }
}

/** A page that fails its test when it asks a host that is not its own or one of `others` (whose pages may ask what they like), breaks the content security policy or throws. */
export async function openPage(context: BrowserContext, url: string, others: string[] = []): Promise<{ page: Page; faults: string[] }> {
  const page = await context.newPage();
  const faults: string[] = [];
  const foreign = others.map((address) => new URL(address).host);
  const hosts = [new URL(url).host, ...foreign];
  page.on("pageerror", (error) => faults.push(error.message));
  page.on("request", (request) => {
    const asked = new URL(request.url());
    const isTheirs = page.url() !== "about:blank" && foreign.includes(new URL(page.url()).host);
    if (!isTheirs && asked.protocol.startsWith("http") && !hosts.includes(asked.host)) faults.push(`asked ${asked.host}`);
  });
  page.on("console", (message) => {
    if (message.text().includes("Content Security Policy")) faults.push(message.text());
  });
  await page.goto(url);
  return { page, faults };
}

/** Until the drag is live and a picture has come. */
export async function live(page: Page): Promise<void> {
  await page.waitForFunction(
    () => {
      const bench = (globalThis as unknown as Hook).tissueform?.bench;
      return bench?.connection.value.kind === "live" && bench.picture.value !== null;
    },
    null,
    { timeout: 60_000 },
  );
}

/** The planner of the case, opened by its file. */
export async function openCase(context: BrowserContext, planner: Pick<Planner, "url" | "casePath">, path = planner.casePath): Promise<{ page: Page; faults: string[] }> {
  const opened = await openPage(context, planner.url);
  await opened.page.setInputFiles("input[type=file]", path);
  await live(opened.page);
  return opened;
}

/** What is on the stage: the largest movement of the skin, the move in the plan, how often was drawn. */
export function state(page: Page) {
  return page.evaluate(() => {
    const { bench, view } = (globalThis as unknown as Hook).tissueform;
    const { shape } = view.head.skins[0];
    let largest = 0;
    for (let i = 0; i < shape.positions.length; i += 3) {
      largest = Math.max(largest, Math.hypot(...[0, 1, 2].map((k) => shape.positions[i + k] - shape.rest[i + k])));
    }
    return {
      largestMm: largest,
      moves: bench.plan.moves.map((move: object) => ({ ...move })) as Record<string, number>[],
      connection: bench.connection.value.kind as string,
      drawn: view.stage.drawnCount as number,
      session: bench.live.session as string,
      followers: bench.followers.value as number,
      legend: bench.map.legend.value as { title: string; mostMm: number; largestMm: number } | null,
      matrix: Array.from(view.head.surfaces.find((s: any) => s.source.entry.handle === "mandible").mesh.matrix.elements) as number[],
    };
  });
}

/** The face has followed: its largest movement lies between these. */
export async function moved(page: Page, least: number, most: number): Promise<void> {
  await page.waitForFunction(
    ([low, high]) => {
      const shape = (globalThis as unknown as Hook).tissueform.view?.head.skins[0].shape;
      if (shape === undefined) return false;
      let largest = 0;
      for (let i = 0; i < shape.positions.length; i += 3) {
        largest = Math.max(largest, Math.hypot(...[0, 1, 2].map((k) => shape.positions[i + k] - shape.rest[i + k])));
      }
      return largest >= low && largest <= high;
    },
    [least, most],
    { timeout: 60_000 },
  );
}

/** The field of a move: "Forward", "Pitch", ... */
export function field(page: Page, label: string) {
  return page.getByRole("textbox", { name: new RegExp(`^${label}`) });
}

export async function typeMove(page: Page, label: string, value: string): Promise<void> {
  await field(page, label).fill(value);
  await field(page, label).press("Enter");
}

export async function takeSegment(page: Page, label: string): Promise<void> {
  await page.locator(".segments button", { hasText: label }).click();
}

/** Clicks the export, and resolves with where its file was saved. */
export async function saveExport({ folder }: Pick<Planner, "folder">, page: Page, button: string, file: string): Promise<string> {
  const [download] = await Promise.all([page.waitForEvent("download"), page.getByRole("button", { name: button }).click()]);
  if (download.suggestedFilename() !== file) throw new Error(`the file is called ${download.suggestedFilename()}, not ${file}`);
  const path = join(folder, file);
  await download.saveAs(path);
  return path;
}

const AXE = readFileSync(process.env.TISSUEFORM_AXE ?? createRequire(join(process.cwd(), "package.json")).resolve("axe-core/axe.min.js"), "utf8");

/** Findings of axe-core that are serious or worse, one a line. */
export async function seriousFindings(page: Page): Promise<string[]> {
  // As a script of the browser, not of the page: the page's policy allows no inline script.
  await page.evaluate(AXE);
  return page.evaluate(async () => {
    const { violations, passes } = await (globalThis as any).axe.run();
    if (passes.length < 10) return ["axe-core has looked at next to nothing"];
    return violations
      .filter(({ impact }: any) => impact === "serious" || impact === "critical")
      .map(({ id, nodes }: any) => `${id}: ${nodes.map((node: any) => node.html).join(" ")}`);
  });
}
