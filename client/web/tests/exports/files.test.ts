// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { execFileSync } from "node:child_process";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { afterAll, expect, test } from "vitest";
import { toPly, toStl } from "../../src/exports/files";

const folder = mkdtempSync(join(tmpdir(), "tissueform-export-"));
afterAll(() => rmSync(folder, { recursive: true }));

const SURFACES = [
  { name: "skin", positions: Float32Array.from([0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0.5]), triangles: Uint32Array.from([0, 1, 2, 1, 3, 2]), bandMm: null },
  { name: "chin", positions: Float32Array.from([5, 5, 5, 6, 5, 5, 5, 6, 5]), triangles: Uint32Array.from([0, 1, 2]), bandMm: null },
];

/** What meshio, an independent reader, reads: numbers of points and triangles, sum of coordinates. */
function readBack(name: string, bytes: Uint8Array): string {
  const path = join(folder, name);
  writeFileSync(path, bytes);
  const script = "import meshio,sys; m=meshio.read(sys.argv[1]); print(len(m.points), sum(len(c.data) for c in m.cells), round(float(m.points.sum()),3), *[f'{name}={list(map(float, row))}' for name, row in m.point_data.items()])";
  return execFileSync("/usr/bin/python3", ["-c", script, path], { encoding: "utf8" }).trim();
}

test("PLY is read by others and says what it is", () => {
  const bytes = toPly(SURFACES, ["case cases/abc", "Zahnärztin\nend_header"]);
  expect(readBack("a.ply", bytes)).toBe("7 3 51.5");
  const text = new TextDecoder("latin1").decode(bytes.slice(0, 400));
  expect(text).toContain("comment not a medical device");
  expect(text).toContain("comment Zahn?rztin?end_header\n");
});

test("PLY has the band of every vertex where it is known of all", () => {
  const banded = SURFACES.map((surface, index) => ({ ...surface, bandMm: Float32Array.from({ length: surface.positions.length / 3 }, (_, i) => index + 0.25 * i) }));
  expect(readBack("band.ply", toPly(banded, []))).toBe("7 3 51.5 band_95_mm=[0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5]");
  expect(readBack("some.ply", toPly([banded[0], SURFACES[1]], []))).toBe("7 3 51.5");
});

test("STL is read by others and says what it is", () => {
  const bytes = toStl(SURFACES, "Model linear_elastic");
  expect(readBack("a.stl", bytes).split(" ").slice(1)).toEqual(["3", "51.5"]);
  const header = new TextDecoder().decode(bytes.slice(0, 80));
  expect(header).toMatch(/^Tissueform, not a medical device/);
});
