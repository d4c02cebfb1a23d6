// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { defineConfig } from "vitest/config";

export default defineConfig({
  base: "./",
  build: {
    outDir: "../../build/web",
    emptyOutDir: true,
    target: "es2022",
    // Nothing in the page itself: its content security policy allows no inline script, style or picture.
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    chunkSizeWarningLimit: 1200,
  },
  // The recipe's schema is in docs.
  server: { fs: { allow: [".", "../../docs"] } },
  test: {
    include: ["tests/**/*.test.ts"],
    setupFiles: ["tests/testing/web_crypto.ts", "tests/testing/files.ts"],
  },
});
