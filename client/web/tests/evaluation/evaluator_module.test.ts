// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { afterEach, beforeEach, expect, test, vi } from "vitest";

// The compiled module is kept for as long as the page, so each test has a page of its own.
let page: typeof import("../../src/evaluation/evaluator_module");

beforeEach(async () => {
  vi.resetModules();
  page = await import("../../src/evaluation/evaluator_module");
});

afterEach(() => vi.unstubAllGlobals());

/** The smallest module: it exports nothing. */
const EMPTY = Uint8Array.from([0, 0x61, 0x73, 0x6d, 1, 0, 0, 0]);

test.each([
  ["missing", async () => new Response("not found", { status: 404 }), "the evaluator (answer_evaluator.wasm) cannot be fetched from the gateway"],
  ["out of reach", () => Promise.reject(new TypeError("no network")), "the evaluator (answer_evaluator.wasm) cannot be fetched from the gateway"],
  ["truncated", async () => new Response(EMPTY.slice(0, 6)), "does not compile: either it is damaged, or this browser has no WebAssembly SIMD"],
  ["of another version", async () => new Response(EMPTY), "has another version than this page: build or install them together"],
])("one that is %s gives one line, and is fetched again", async (_what, fetchIt, message) => {
  vi.stubGlobal("fetch", fetchIt);
  const failed = page.evaluatorModule();
  await expect(failed).rejects.toThrow(page.NoEvaluatorError);
  await expect(failed).rejects.toThrow(message);
  vi.unstubAllGlobals();
  const module = await page.evaluatorModule();
  expect(await page.evaluatorModule()).toBe(module);
});

test("a browser without WebAssembly gets an error that names it", async () => {
  vi.stubGlobal("WebAssembly", undefined);
  await expect(page.evaluatorModule()).rejects.toThrow("this browser has no WebAssembly, or it is switched off");
});
