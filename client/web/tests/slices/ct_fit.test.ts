// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { readFileSync } from "node:fs";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { gunzipSync } from "node:zlib";
import { describe, expect, test } from "vitest";
import { surfaceNets } from "../../src/building/surface_nets";
import { fitOfCt, objectionToCt } from "../../src/slices/ct_fit";
import type { Grid, Volume } from "../../src/volume/volume";

// The skin of the bundled head against the CT that it is of, and against others.

const HEAD = join(fileURLToPath(new URL("../../../..", import.meta.url)), "tests/data/ct/headsq/headsq_quarter.raw.gz");
const bytes = gunzipSync(readFileSync(HEAD));
/** HU + 1024. */
const raw = new Int16Array(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length));
const grid: Grid = { size: [64, 64, 93], spacing: [3.2, 3.2, 1.5], origin: [0, 0, 0], directions: [[-1, 0, 0], [0, 1, 0], [0, 0, -1]] };
const ct: Volume = { grid, values: raw, kernel: "" };
const net = surfaceNets(grid, Float32Array.from(raw), 1024 - 300);
const shareOf = (volume: Volume) => fitOfCt(volume, [net]).share;
const at = (change: Partial<Grid>): Volume => ({ ...ct, grid: { ...grid, ...change } });

describe("a CT belongs to a case by its skin", () => {
  test.each([["as stored", ct], ["in HU", { ...ct, values: raw.map((value) => value - 1024) }]])("the one that it was built from: %s", (_, volume) => {
    const fit = fitOfCt(volume, [net]);
    expect(fit.points).toBeGreaterThan(500);
    expect(fit.share).toBeGreaterThan(0.9);
    expect(objectionToCt(fit)).toBe("");
  });

  test.each<[string, Volume]>([
    ["of a head that was scanned elsewhere", at({ origin: [8, 8, 8] })],
    ["of a larger head", at({ spacing: [3.5, 3.5, 1.65], origin: [10, -10, 7] })],
    ["of a mirrored head", at({ directions: [[1, 0, 0], [0, 1, 0], [0, 0, -1]], origin: [-201.6, 0, 0] })],
    ["that is far away", at({ origin: [1000, 0, 0] })],
    ["without tissue", { ...ct, values: new Int16Array(raw.length) }],
  ])("not one %s", (_, volume) => {
    expect(shareOf(volume)).toBeLessThan(0.6);
    expect(objectionToCt(fitOfCt(volume, [net]))).toMatch(/^this CT does not belong to the case: only \d+ % of the case's skin .*; open the CT that the case was built from$/);
  });
});
