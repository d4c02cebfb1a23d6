// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { EvaluationError, type EvaluatorExports } from "./answer_evaluator";

/** It is because of the browser or the module, and not of the bytes. */
export class NoEvaluatorError extends EvaluationError {
  override readonly name = "NoEvaluatorError";
}

const NAMES: readonly (keyof EvaluatorExports)[] = [
  "memory", "_initialize", "reserve", "open", "message", "num_handles", "num_vertices", "is_estimate", "has_band",
  "poses", "evaluate", "error_mm", "positions", "evaluate_band", "band_mm",
];

let compiled: Promise<WebAssembly.Module> | null = null;

/** The evaluator, compiled once per page. Rejects with a NoEvaluatorError, and tries again when it is asked again. */
export function evaluatorModule(): Promise<WebAssembly.Module> {
  compiled ??= compile().catch((thrown: unknown) => {
    compiled = null;
    throw thrown;
  });
  return compiled;
}

async function compile(): Promise<WebAssembly.Module> {
  if (typeof WebAssembly === "undefined") throw new NoEvaluatorError("this browser has no WebAssembly, or it is switched off");
  const binary = await load(new URL("../generated/answer_evaluator.wasm", import.meta.url));
  let module: WebAssembly.Module;
  try {
    module = await WebAssembly.compile(binary);
  } catch {
    throw new NoEvaluatorError("the evaluator (answer_evaluator.wasm) does not compile: either it is damaged, or this browser has no WebAssembly SIMD (new in 2021 to 2023)");
  }
  const names = new Set(WebAssembly.Module.exports(module).map(({ name }) => name));
  if (!NAMES.every((name) => names.has(name))) throw new NoEvaluatorError("the evaluator (answer_evaluator.wasm) has another version than this page: build or install them together");
  return module;
}

/** A moving file contains it as a data URL, because its content security policy allows no fetch. */
async function load(url: URL): Promise<Uint8Array<ArrayBuffer>> {
  if (url.protocol === "data:") return Uint8Array.from(atob(url.href.slice(url.href.indexOf(",") + 1)), (letter) => letter.charCodeAt(0));
  const reply = await fetch(url).catch(() => null);
  if (reply === null || !reply.ok) throw new NoEvaluatorError("the evaluator (answer_evaluator.wasm) cannot be fetched from the gateway");
  return new Uint8Array(await reply.arrayBuffer());
}
