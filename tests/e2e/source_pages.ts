// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { createRequire } from "node:module";
import { join } from "node:path";
import { pathToFileURL } from "node:url";
import { type Browser, type BrowserContextOptions, type Page, chromium } from "playwright-core";
import { CHROMIUM } from "./planner";

interface SourceServer {
  close(): Promise<void>;
  resolvedUrls: { local: string[] };
}

/** Pages of client/web/tests, from their sources, in Debian's Chromium: parts of the planner without server and gateway. */
export class SourcePages {
  private constructor(private readonly server: SourceServer, private readonly browser: Browser) {}

  static async start(): Promise<SourcePages> {
    const { createServer } = await import(pathToFileURL(createRequire(join(process.cwd(), "package.json")).resolve("vite")).href);
    const made = await createServer({
      root: process.cwd(), configFile: false, logLevel: "error", cacheDir: "node_modules/.vite-slices", optimizeDeps: { noDiscovery: true, include: [] },
      server: { host: "127.0.0.1", port: 0, hmr: false, watch: null, fs: { strict: false } },
    });
    const browser = await chromium.launch({ executablePath: CHROMIUM, args: ["--no-sandbox", "--enable-unsafe-swiftshader", "--disable-dev-shm-usage"] });
    return new SourcePages(await made.listen(), browser);
  }

  /** `path`: within client/web. */
  async open(path: string, options: BrowserContextOptions): Promise<Page> {
    const page = await (await this.browser.newContext(options)).newPage();
    await page.goto(`${this.server.resolvedUrls.local[0]}${path}`);
    return page;
  }

  async stop(): Promise<void> {
    await this.browser.close();
    await this.server.close();
  }
}
