// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { afterAll, beforeAll, describe, expect, test } from "vitest";
import { openCtHere } from "../../src/volume/ct_input";
import { nrrdOf } from "../../src/volume/nrrd_file";
import { named, SECRET } from "./dicom_writer";

// Files of several frames that pydicom writes, against the voxels that pydicom reads of them.

const WRITER = join(dirname(fileURLToPath(import.meta.url)), "write_multi_frame.py");
const GRID = { size: [64, 64, 20], spacing: [3.2, 3.2, 1.5], origin: [-10, 20, 900], directions: [[1, 0, 0], [0, 1, 0], [0, 0, 1]] };

const folder = mkdtempSync(join(tmpdir(), "tissueform-frames-"));
beforeAll(() => void execFileSync("/usr/bin/python3", ["-B", WRITER, folder]), 60_000);
afterAll(() => rmSync(folder, { recursive: true }));

const bytesOf = (name: string) => new Uint8Array(readFileSync(join(folder, name)));
const fileOf = (name: string) => named(`${SECRET}/${name}`, bytesOf(name));
const open = (...names: string[]) => openCtHere(names.map(fileOf), () => {});

async function read(name: string) {
  const opened = await open(name);
  expect(opened.series.map(({ objections }) => objections)).toEqual([[]]);
  return { opened, volume: await opened.read(opened.proposed!, () => {}) };
}

function expected(name: string): Int16Array {
  const bytes = bytesOf(name);
  return new Int16Array(bytes.buffer, bytes.byteOffset, bytes.length / 2);
}

describe("a file of several frames", () => {
  test("is read with the values and places of an Enhanced CT's frames, which are out of order", async () => {
    const { opened, volume } = await read("enhanced.dcm");
    expect(volume.grid).toEqual(GRID);
    expect(volume.values).toEqual(expected("enhanced.raw"));
    expect([volume.kernel, opened.series[0].slices]).toEqual(["Br40", 20]);
    expect(opened.notes).toEqual(["The rescale differs between the slices: each slice is converted to HU by its own."]);
  });

  test("of the plain CT class has its frames along the normal, with a note", async () => {
    const { opened, volume } = await read("cone_beam.dcm");
    expect(volume.grid).toEqual(GRID);
    expect(volume.values).toEqual(expected("cone_beam.raw"));
    expect(opened.notes.join()).toContain("its frames are placed by SpacingBetweenSlices");
  });

  test.each(["--jpeg", "--jpegls", "--j2k", "--rle"])("compressed by GDCM (%s) gives the same values", async (option) => {
    execFileSync("gdcmconv", [option, join(folder, "enhanced.dcm"), join(folder, "packed.dcm")]);
    expect((await read("packed.dcm")).volume.values).toEqual(expected("enhanced.raw"));
  });

  test("that is truncated is refused with its frame, and sends nothing of the patient", async () => {
    const cut = bytesOf("enhanced.dcm").subarray(0, -3000).slice();
    const opened = await openCtHere([named("enhanced.dcm", cut)], () => {});
    const message = await opened.read(opened.proposed!, () => {}).then(() => "", (error: Error) => error.message);
    expect(message).toMatch(/^file 1 of the folder, frame \d+ \(instance number 1\) cannot be read: it is truncated/);
    const { volume } = await read("enhanced.dcm");
    const nrrd = Buffer.from(await (await nrrdOf(volume, () => {})).arrayBuffer()).toString("latin1");
    for (const text of [SECRET, "1.2.3.77", "20200102"]) expect(nrrd + JSON.stringify([opened.series, opened.notes, message])).not.toContain(text);
  });

  test("twice is one CT; between two series of frames the rule does not choose", async () => {
    const twice = await openCtHere([fileOf("enhanced.dcm"), named(`${SECRET}/copy.dcm`, bytesOf("enhanced.dcm"))], () => {});
    expect(twice.notes).toContain("Left out: 1 file with the same bytes as another one.");
    expect((await twice.read(twice.proposed!, () => {})).values).toEqual(expected("enhanced.raw"));
    const other = Buffer.from(bytesOf("cone_beam.dcm"));
    other.write("1.2.3.77.2", other.indexOf("1.2.3.77.1"), "latin1");
    const two = await openCtHere([fileOf("enhanced.dcm"), named(`${SECRET}/other.dcm`, new Uint8Array(other))], () => {});
    expect([two.series.length, two.proposed]).toEqual([2, null]);
    expect(two.notes.join()).toContain("does not judge files of several frames");
  });
});
