// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// Makes build/web/moving-file.html: the page of a file that moves (src/movingfile) with its script and style in it, and marks where
// its data belong. `tissueform export` and the planner fill it (docs/moving-file.md).

import { createHash } from "node:crypto";
import { readFileSync, writeFileSync } from "node:fs";
import { fileURLToPath } from "node:url";
import { build } from "vite";

const path = (relative) => fileURLToPath(new URL(relative, import.meta.url));

const bundle = await build({
  root: path("."),
  configFile: false,
  logLevel: "warn",
  publicDir: false,
  build: {
    write: false,
    target: "es2022",
    cssCodeSplit: false,
    // The evaluator, too: the page is one file.
    assetsInlineLimit: Number.MAX_SAFE_INTEGER,
    modulePreload: { polyfill: false },
    chunkSizeWarningLimit: 1200,
    rollupOptions: { input: path("src/movingfile/main.ts"), output: { format: "iife", inlineDynamicImports: true } },
  },
  worker: { format: "iife" },
});

const files = [bundle].flat().flatMap(({ output }) => output);
const chunks = files.filter((file) => file.type === "chunk");
const styles = files.filter((file) => file.fileName.endsWith(".css"));
if (chunks.length !== 1 || styles.length !== 1 || files.length !== 2) {
  throw new Error(`the page is to be one script and one style, and is ${files.map((file) => file.fileName).join(", ")}`);
}

// What would end the element that it stands in, or begin a comment.
const script = chunks[0].code.replace(/<\/(script)/gi, "<\\/$1").replace(/<!--/g, "<\\!--");
const style = String(styles[0].source);
const hash = (text) => `'sha256-${createHash("sha256").update(text).digest("base64")}'`;
const policy = [
  "default-src 'none'",
  `script-src ${hash(script)} 'wasm-unsafe-eval'`,
  `style-src ${hash(style)}`,
  "worker-src blob:",
  "connect-src 'none'",
  "base-uri 'none'",
  "form-action 'none'",
].join("; ");

const parts = { "@TISSUEFORM-POLICY@": policy, "@TISSUEFORM-STYLE@": style, "@TISSUEFORM-SCRIPT@": script };
for (const [mark, text] of Object.entries(parts)) {
  if (text.includes("@TISSUEFORM-")) throw new Error(`${mark} holds a mark`);
}
const page = readFileSync(path("moving-file.template.html"), "utf8").replace(/@TISSUEFORM-(POLICY|STYLE|SCRIPT)@/g, (mark) => parts[mark]);
writeFileSync(path("../../build/web/moving-file.html"), page);
