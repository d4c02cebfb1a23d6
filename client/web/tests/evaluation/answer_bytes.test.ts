// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { createHash } from "node:crypto";
import { expect, test } from "vitest";
import { EvaluationError } from "../../src/evaluation/answer_evaluator";
import { GOLDEN, goldenBytes, openBytes } from "./golden_answers";

// What core/mechanics/answer_evaluator refuses has its tests there; here, that its words reach the page.

/** The place of a section's bytes. */
function offsetOf(bytes: Uint8Array, number: number): number {
  const view = new DataView(bytes.buffer);
  for (let i = 0; i < view.getUint32(12, true); ++i) {
    if (view.getUint32(16 + 16 * i, true) === number) return view.getUint32(16 + 16 * i + 8, true);
  }
  throw new Error(`no section ${number}`);
}

function changed(name: string, change: (view: DataView, bytes: Uint8Array) => void): Uint8Array {
  const bytes = goldenBytes(name);
  change(new DataView(bytes.buffer), bytes);
  return bytes;
}

// With 32 bits a size: no sum of them may wrap around.
test.each(GOLDEN)("%s with any byte turned over is refused or may be evaluated", async (name) => {
  const bytes = goldenBytes(name);
  for (let at = 0; at < 2000; at += 3) {
    const damaged = bytes.slice();
    damaged[at] ^= 0xff;
    const outcome = await openBytes(damaged).catch((error: unknown) => error);
    if (outcome instanceof Error) expect(outcome).toBeInstanceOf(EvaluationError);
  }
});

test.each([
  ["too large", new Uint8Array(2 ** 28 + 1), "prepared answers of 268435457 bytes; at most 268435456 are read"],
  ["something else", new TextEncoder().encode("something else, and long enough"), "these are not prepared answers"],
  ["nothing", new Uint8Array(0), "these are not prepared answers"],
  ["half of it", goldenBytes("linear_elastic").slice(0, 5000), "prepared answers are incomplete or damaged; fetch them again"],
  ["a later version", changed("linear_elastic", (view) => view.setUint32(8, 5, true)), "prepared answers of version 5; this reader knows 1 to 4"],
  ["no number", changed("gradient_field", (view, bytes) => view.setFloat64(offsetOf(bytes, 20), NaN, true)), "a value of the prepared answers is not finite"],
])("%s is refused in one line", async (_what, bytes, message) => {
  await expect(openBytes(bytes)).rejects.toThrow(new EvaluationError(message));
});

test("bytes of another hash are refused", async () => {
  const bytes = goldenBytes("linear_elastic");
  const sha256 = createHash("sha256").update(bytes).digest("hex");
  await expect(openBytes(bytes, sha256)).resolves.toBeDefined();
  await expect(openBytes(bytes, sha256.replace(/^./, (digit) => (digit === "0" ? "1" : "0")))).rejects.toThrow("announced SHA-256");
});
