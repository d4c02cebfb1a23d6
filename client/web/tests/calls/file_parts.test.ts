// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { expect, test } from "vitest";
import { type FilePart, readParts } from "../../src/calls/file_parts";

async function* parts(...all: [offset: number, text: string, total: number][]): AsyncGenerator<FilePart> {
  for (const [offset, text, total] of all) yield { offset: BigInt(offset), data: new TextEncoder().encode(text), totalBytes: BigInt(total) };
}

test("parts that follow each other are one file, with its progress", async () => {
  const shares: number[] = [];
  const file = await readParts(() => parts([0, "abc", 4], [3, "d", 4]), "the CT", 100, (share) => shares.push(share));
  expect(await file.text()).toBe("abcd");
  expect(shares).toEqual([0.75, 1]);
});

test("an empty file is empty", async () => {
  expect((await readParts(() => parts([0, "", 0]), "the CT", 100)).size).toBe(0);
});

test.each([
  ["a gap", parts([0, "abc", 5], [4, "e", 5]), "out of order"],
  ["an early end", parts([0, "abc", 5]), "3 of 5 bytes"],
  ["more than expected", parts([0, "abc", 101]), "too large"],
])("%s is an error", async (_, source, text) => {
  await expect(readParts(() => source, "the CT", 100)).rejects.toThrow(text);
});
