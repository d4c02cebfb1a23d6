// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { deflateSync } from "node:zlib";
import { afterAll, beforeAll, describe, expect, test } from "vitest";
import { openCtHere } from "../../src/volume/ct_input";
import { nrrdOfLabels } from "../../src/volume/nrrd_file";
import type { Grid, LabelMap } from "../../src/volume/volume";
import { readLabels } from "../../src/volume/volume_file";
import { named } from "./dicom_writer";

// The phantom of tests/core/imaging/labels/write_labels.py: boxes in a head that is turned by 10 degrees.

const SIZE = [20, 24, 16];
const [COS, SIN] = [Math.cos(Math.PI / 18), Math.sin(Math.PI / 18)];
const GRID: Grid = { size: [20, 24, 16], spacing: [1.5, 1, 2], origin: [-12, 30, 900], directions: [[COS, SIN, 0], [-SIN, COS, 0], [0, 0, 1]] };
/** Of single precision, which NIfTI's places have. */
const FLOAT32_DIGITS = 4;
const folder = mkdtempSync(join(tmpdir(), "tissueform-labels-"));

beforeAll(() => {
  execFileSync("/usr/bin/python3", [fileURLToPath(new URL("../../../../tests/core/imaging/labels/write_labels.py", import.meta.url)), folder], { stdio: "pipe" });
}, 60_000);
afterAll(() => rmSync(folder, { recursive: true }));

const file = (name: string) => named(name, new Uint8Array(readFileSync(join(folder, name))));
const isIn = (voxel: readonly number[], box: readonly (readonly [number, number])[]) => box.every(([from, to], axis) => voxel[axis] >= from && voxel[axis] < to);

function phantom(): number[] {
  const values: number[] = [];
  for (let k = 0; k < SIZE[2]; ++k) {
    for (let j = 0; j < SIZE[1]; ++j) {
      for (let i = 0; i < SIZE[0]; ++i) {
        const at = [i, j, k];
        if (isIn(at, [[5, 8], [6, 10], [3, 6]])) values.push(5);
        else if (isIn(at, [[3, 10], [4, 13], [2, 7]])) values.push(2);
        else values.push(isIn(at, [[3, 16], [4, 21], [8, 15]]) ? 1 : 0);
      }
    }
  }
  return values;
}

function expectGrid(grid: Grid, digits: number): void {
  expect(grid.size).toEqual(GRID.size);
  const numbers = ({ spacing, origin, directions }: Grid) => [...spacing, ...origin, ...directions.flat()];
  const expected = numbers(GRID);
  numbers(grid).forEach((value, i) => expect(value).toBeCloseTo(expected[i], digits));
}

describe("label maps of other programs", () => {
  test.each([["numbers.nii.gz", "nibabel", FLOAT32_DIGITS], ["float.nii", "nibabel, as numbers with a fraction", FLOAT32_DIGITS], ["one_layer.seg.nrrd", "Teem, with Slicer's names", 9]])("%s of %s", async (name, _, digits) => {
    const labels = await readLabels(file(name));
    expectGrid(labels.grid, digits);
    expect([...labels.values]).toEqual(phantom());
  });

  test("name their numbers", async () => {
    expect([...(await readLabels(file("named.nii.gz"))).names]).toEqual([[71, "skull"], [40, "mandible"], [9, "inferior_alveolar_canal_left"]]);
    expect((await readLabels(file("one_layer.seg.nrrd"))).names.get(1)).toBe("Upper skull");
  });

  test.each([
    ["probability.nii", "labels are whole numbers from 0 to 65535"],
    ["negative.nii", "the file has the value -1024"],
    ["empty.nii", "no voxel of the file is labelled"],
    ["layers.seg.nrrd", "the file holds 2 layers or volumes"],
    ["vtk.mha", "without \"AnatomicalOrientation\""],
  ])("%s is refused", async (name, message) => expect(readLabels(file(name))).rejects.toThrow(message));

  test("cut off are refused", async () => {
    for (const name of ["numbers.nii.gz", "float.nii", "one_layer.seg.nrrd"]) {
      const { file: whole } = file(name);
      await expect(readLabels({ path: name, file: whole.slice(0, whole.size - 60) })).rejects.toThrow("truncated, damaged");
      await expect(readLabels({ path: name, file: whole.slice(0, 100) })).rejects.toThrow("truncated, damaged");
    }
  });

  test("are written as they are read", async () => {
    const labels = await readLabels(file("one_layer.seg.nrrd"));
    const again: LabelMap = await readLabels({ path: "again.nrrd", file: await nrrdOfLabels(labels) });
    expectGrid(again.grid, 9);
    expect(again.values).toEqual(labels.values);
    expect(again.names).toEqual(labels.names);
  });
});

describe("volume files", () => {
  const values = Int16Array.from({ length: 8 * 9 * 10 }, (_, i) => i * 50 - 1000);
  const bytes = new Uint8Array(values.buffer);
  const headers = {
    nrrd: "NRRD0004\ntype: short\ndimension: 3\nspace: RAS\nsizes: 8 9 10\nspace directions: (-2,0,0) (0,-3,0) (0,0,4)\nendian: little\nencoding: raw\nspace origin: (1,2,3)\n\n",
    mha: "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nCompressedData = True\nTransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = -1 -2 3\nAnatomicalOrientation = RAI\nElementSpacing = 2 3 4\nDimSize = 8 9 10\nElementType = MET_SHORT\nElementDataFile = LOCAL\n",
  };
  const files = {
    nrrd: named("ct.nrrd", Uint8Array.from([...Buffer.from(headers.nrrd), ...bytes])),
    mha: named("ct.mha", Uint8Array.from([...Buffer.from(headers.mha), ...deflateSync(bytes)])),
  };

  test.each(["nrrd", "mha"] as const)("%s is one series, in LPS", async (kind) => {
    const opened = await openCtHere([files[kind]], () => {});
    expect(opened.series).toMatchObject([{ id: "1", slices: 10, size: [8, 9], millimeters: [16, 27, 40], objections: [] }]);
    const volume = await opened.read(opened.proposed!, () => {});
    expect(volume.grid).toEqual({ size: [8, 9, 10], spacing: [2, 3, 4], origin: [-1, -2, 3], directions: [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((v) => v.map((x) => expect.closeTo(x, 12))) });
    expect(volume.values).toEqual(values);
  });

  test.each([
    ["without a space", headers.nrrd.replace("space: RAS\n", ""), "does not say how it lies in the patient"],
    ["with a data file", headers.nrrd.replace("encoding: raw", "data file: a.raw"), "names a data file beside it"],
    ["too large", headers.nrrd.replace("8 9 10", "2000 2000 2000"), "8000000000 voxels (14.9 GiB)"],
    ["with wide voxels", headers.nrrd.replace("(0,0,4)", "(0,0,40)"), "40 mm apart along axis 3"],
  ])("%s is refused", async (_, header, message) => expect(openCtHere([named("ct.nrrd", header)], () => {})).rejects.toThrow(message));
});
