// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { expect, test } from "vitest";
import { CallError, Code } from "../../src/calls/call_error";
import { serverSource } from "../../src/case/case_sources";
import { formatProgress } from "../../src/planning/numbers";
import { FakeClock } from "../testing/fake_clock";

const BYTES = Uint8Array.from({ length: 100 }, (_, i) => i);
const settle = () => new Promise((done) => setImmediate(done));

/** What a call does after its messages of ten bytes. */
type Ending = "ends" | "breaks" | "hangs";

/** A server whose calls bring so many messages each, and then end so; the last one for all that follow. */
function server(...calls: [messages: number, ending: Ending][]) {
  const clock = new FakeClock();
  const offsets: number[] = [];
  async function* readCase({ readOffset, readLimit }: { readOffset: bigint; readLimit: bigint }, { signal }: { signal: AbortSignal }) {
    const [messages, ending] = calls[Math.min(offsets.length, calls.length - 1)];
    const [from, to] = [Number(readOffset), Number(readOffset + readLimit)];
    offsets.push(from);
    for (let at = from; at < Math.min(to, from + 10 * messages); at += 10) yield { data: BYTES.subarray(at, Math.min(to, at + 10)) };
    if (ending === "breaks") throw new CallError(Code.Unavailable, "gone");
    if (ending === "hangs") await new Promise((_, reject) => signal.addEventListener("abort", () => reject(signal.reason)));
  }
  const source = serverSource({ cases: { readCase } } as never, { name: "cases/a", totalBytes: 100n }, clock.timer);
  return { clock, offsets, source };
}

test("a download reports its progress", async () => {
  const { source, offsets } = server([10, "ends"]);
  const reported: number[] = [];
  expect(await source.read(20, 35, (count) => reported.push(count))).toEqual(BYTES.slice(20, 55));
  expect(reported).toEqual([10, 20, 30, 35]);
  expect(offsets).toEqual([20]);
});

test("one that breaks off goes on where it was, as often as it brings something", async () => {
  const { source, offsets } = server([1, "breaks"]);
  expect(await source.read(0, 100)).toEqual(BYTES);
  expect(offsets).toEqual([0, 10, 20, 30, 40, 50, 60, 70, 80, 90]);
});

test("one that brings nothing is given up", async () => {
  const { source, offsets } = server([2, "breaks"], [0, "breaks"]);
  await expect(source.read(0, 100)).rejects.toThrow("gone");
  expect(offsets).toEqual([0, 20, 20, 20, 20]);
});

test("one that stands still goes on over another connection", async () => {
  const { source, offsets, clock } = server([3, "hangs"], [10, "ends"]);
  const read = source.read(0, 100);
  await settle();
  clock.pass(29);
  await settle();
  expect(offsets).toEqual([0]);
  clock.pass(1);
  expect(await read).toEqual(BYTES);
  expect(offsets).toEqual([0, 30]);
});

test("where no connection delivers data the reason is reported", async () => {
  const { source, clock } = server([0, "hangs"]);
  const read = source.read(0, 100).catch((error: Error) => error.message);
  for (let tries = 0; tries < 4; ++tries) {
    await settle();
    clock.pass(30);
  }
  expect(await read).toBe("no data from the server for 30 s");
});

test("progress is shown in megabytes and percent", () => {
  expect(formatProgress(0, 5_200_000)).toBe("0.0 of 5.2 MB, 0 %");
  expect(formatProgress(5_199_999, 5_200_000)).toBe("5.2 of 5.2 MB, 99 %");
});
