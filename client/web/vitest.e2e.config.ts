// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { fileURLToPath } from "node:url";
import { defineConfig } from "vitest/config";

const path = (relative: string) => fileURLToPath(new URL(relative, import.meta.url));

// The suite that drives a browser: tests/e2e, with the packages of this folder. With --mode measure or pictures: figures and
// pictures of docs/planner.md.
export default defineConfig(({ mode }) => ({
  root: path("../../tests/e2e"),
  cacheDir: path("node_modules/.vite-e2e"),
  resolve: { alias: { "playwright-core": path("node_modules/playwright-core/index.mjs"), "puppeteer-core": path("node_modules/puppeteer-core/lib/esm/puppeteer/puppeteer-core.js"), "oidc-provider": path("node_modules/oidc-provider/lib/index.js") } },
  server: { fs: { strict: false } },
  test: {
    globals: true,
    setupFiles: [path("tests/testing/files.ts")],
    include: mode === "test" ? ["**/*.test.ts"] : [`${mode}.ts`],
    testTimeout: 120_000,
    hookTimeout: 90_000,
    // Tests go on where the one before them left the page: after the first that fails nothing more is learnt, and CTest would
    // kill what waits on without a word of which it was.
    bail: 1,
    // By default a second, which a browser on a busy machine does not keep.
    expect: { poll: { timeout: 30_000 } },
    reporters: "verbose",
    // Browsers without a graphics card take all processors that they get.
    fileParallelism: false,
  },
}));
