// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { afterEach, beforeEach, expect, test, vi } from "vitest";
import type { Gateway } from "../../src/calls/gateway";
import type { CaseFile } from "../../src/case/case_file";
import { type BandQuestion, findBand } from "../../src/workbench/resting_band";

const FILE = { manifest: { handles: [{ name: "mandible" }] }, followed: Int32Array.of(4, 7), materialRanges: { factors95: [2] } } as unknown as CaseFile;
const POSE = { rotationVector: [0, 0, 0], pivotMm: [0, 0, 0], translationMm: [0, -3, 0], scale: 1 } as BandQuestion["poses"][number];
const ask = (): BandQuestion => ({ file: FILE, session: "sessions/a", model: 3, poses: [POSE] });

const deformOnce = vi.fn();
const gateway = { deform: { deformOnce } } as unknown as Gateway;
const answer = (values: number[], noUncertainty = "") => ({ uncertaintyP95Mm: new Uint8Array(Float32Array.from(values).buffer), noUncertainty });

beforeEach(() => {
  vi.useFakeTimers();
  deformOnce.mockReset();
});
afterEach(() => vi.useRealTimers());

async function found(): ReturnType<typeof findBand> {
  const result = findBand(gateway, ask, new AbortController().signal);
  await vi.runAllTimersAsync();
  return result;
}

test("the ranges of the case are asked for, of the vertices that the page follows", async () => {
  deformOnce.mockResolvedValue(answer([0.5, 0.25]));
  const { bandMm, reason } = await found();
  expect([Array.from(bandMm ?? []), reason]).toEqual([[0.5, 0.25], ""]);
  const [request] = deformOnce.mock.calls[0];
  expect(request).toMatchObject({ session: "sessions/a", model: 3, vertices: { selection: { value: { vertices: [4, 7] } } }, ranges: { factors95: [2] } });
  expect(request.poses[0]).toMatchObject({ handle: "mandible", translationMm: { y: -3 } });
});

test("where it is not known the reason is given", async () => {
  deformOnce.mockResolvedValue(answer([], "it is not known of sealed lips"));
  expect(await found()).toEqual({ bandMm: null, reason: "it is not known of sealed lips" });
});

test("a hand that moves on asks nothing", async () => {
  const moving = new AbortController();
  const result = findBand(gateway, ask, moving.signal);
  const refused = expect(result).rejects.toThrow();
  moving.abort();
  await vi.runAllTimersAsync();
  await refused;
  expect(deformOnce).not.toHaveBeenCalled();
});

test("an answer of other vertices is refused", async () => {
  deformOnce.mockResolvedValue(answer([1, 2, 3]));
  const result = findBand(gateway, ask, new AbortController().signal);
  const refused = expect(result).rejects.toThrow("another number of vertices");
  await vi.runAllTimersAsync();
  await refused;
});
