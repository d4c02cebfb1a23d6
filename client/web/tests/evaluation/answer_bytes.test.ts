// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { createHash } from "node:crypto";
import { describe, expect, test } from "vitest";
import { AnswersError, readAnswers } from "../../src/evaluation/answer_bytes";
import { makeEvaluator } from "../../src/evaluation/evaluator";
import { GOLDEN, goldenBytes } from "./golden_answers";

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

describe.each(GOLDEN)("%s", (name) => {
  test("is refused wherever it is truncated", () => {
    const bytes = goldenBytes(name);
    for (let length = 0; length < bytes.length; length += 16 + Math.floor(bytes.length / 200)) {
      expect(() => readAnswers(bytes.slice(0, length))).toThrow(AnswersError);
    }
  });

  test("with any byte turned over is refused or may be evaluated", async () => {
    const bytes = goldenBytes(name);
    for (let at = 0; at < 2000; at += 3) {
      const damaged = bytes.slice();
      damaged[at] ^= 0xff;
      const outcome = await makeEvaluator(damaged).catch((error: unknown) => error);
      if (outcome instanceof Error) expect(outcome).toBeInstanceOf(AnswersError);
    }
  });

  test("lies anywhere in memory", () => {
    const bytes = goldenBytes(name);
    const shifted = new Uint8Array(bytes.length + 5);
    shifted.set(bytes, 5);
    expect(readAnswers(shifted.subarray(5))).toEqual(readAnswers(bytes));
  });
});

test.each([
  ["too large", goldenBytes("linear_elastic"), 1000, "prepared answers of 38432 bytes; at most 1000 are read"],
  ["something else", new TextEncoder().encode("something else, and long enough"), undefined, "these are not prepared answers"],
  ["a later version", changed("linear_elastic", (view) => view.setUint32(8, 3, true)), undefined, "prepared answers of version 3; this reader knows 1 to 2"],
  ["too many sections", changed("linear_elastic", (view) => view.setUint32(12, 1001, true)), undefined, "prepared answers are incomplete or damaged; fetch them again"],
  ["no number", changed("gradient_field", (view, bytes) => view.setFloat64(offsetOf(bytes, 20), NaN, true)), undefined, "a value of the prepared answers is not finite"],
  ["endless", changed("linear_elastic", (view, bytes) => view.setFloat64(offsetOf(bytes, 24), Infinity, true)), undefined, "a value of the prepared answers is not finite"],
  ["an unknown handle", changed("linear_elastic", (view, bytes) => view.setInt32(offsetOf(bytes, 2), 2, true)), undefined, "regions and rest positions do not fit together"],
  ["a vertex twice", changed("neo_hookean", (view, bytes) => view.setInt32(offsetOf(bytes, 34), view.getInt32(offsetOf(bytes, 34) + 4, true), true)), undefined, "the clusters' sizes do not fit"],
  ["another model", changed("linear_elastic", (view, bytes) => view.setFloat64(offsetOf(bytes, 1), 3, true)), undefined, "a section belongs to another model"],
  ["a section of a later version", changed("neo_hookean_third_order", (view) => view.setUint32(8, 1, true)), undefined, "a section belongs to a later version"],
])("%s is refused in one line", (_what, bytes, most, message) => {
  expect(() => readAnswers(bytes, most)).toThrow(new AnswersError(message));
});

test("bytes of another hash are refused", async () => {
  const bytes = goldenBytes("linear_elastic");
  const sha256 = createHash("sha256").update(bytes).digest("hex");
  await expect(makeEvaluator(bytes, { sha256 })).resolves.toBeDefined();
  await expect(makeEvaluator(bytes, { sha256: sha256.replace(/^./, (digit) => (digit === "0" ? "1" : "0")) })).rejects.toThrow("announced SHA-256");
});
