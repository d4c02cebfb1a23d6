// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { gunzipSync } from "node:zlib";
import { zipSync } from "fflate";
import { afterAll, describe, expect, test } from "vitest";
import { openCtHere } from "../../src/volume/ct_input";
import { nrrdOf } from "../../src/volume/nrrd_file";
import type { OpenedCt } from "../../src/volume/opened_ct";
import { dicomFolder, dicomSlice, named, patternOf, SECRET, type NamedFile, type SliceOptions } from "./dicom_writer";

const open = (files: readonly NamedFile[]): Promise<OpenedCt> => openCtHere(files, () => {});
const SLICES = 10;
const ofSlices = (count: number) => Int16Array.from(Array.from({ length: count }, (_, k) => [...patternOf(6, 5, k)]).flat());

async function readProposed(files: readonly NamedFile[]) {
  const opened = await open(files);
  expect(opened.series.flatMap(({ objections }) => objections)).toEqual([]);
  return opened.read(opened.proposed!, () => {});
}

async function objectionTo(files: readonly NamedFile[]): Promise<string> {
  const opened = await open(files);
  expect(opened.proposed).toBeNull();
  expect(opened.series).toHaveLength(1);
  await expect(opened.read(opened.series[0].id, () => {})).rejects.toThrow("cannot be used");
  return opened.series[0].objections.join("; ");
}

const withTexts = (texts: SliceOptions["texts"]) => () => ({ texts });

describe("a folder of slices", () => {
  test("is one volume, sorted by position and not by name", async () => {
    const volume = await readProposed(dicomFolder(SLICES));
    expect(volume.grid).toEqual({ size: [5, 6, SLICES], spacing: [0.25, 0.5, 2], origin: [-10, -20, 0], directions: [[1, 0, 0], [0, 1, 0], [0, 0, 1]] });
    expect(volume.values).toEqual(ofSlices(SLICES));
    expect(volume.kernel).toBe("H30s");
  });

  test("is listed as it is", async () => {
    const { series } = await open(dicomFolder(SLICES));
    expect(series).toEqual([{ id: "1", modality: "CT", kernel: "H30s", slices: SLICES, size: [5, 6], sliceSpacing: 2, pixelSpacing: 0.25, millimeters: [1.25, 3, 20], description: "Head 1.0", objections: [] }]);
  });

  test("reports its progress up to the end", async () => {
    const shares: number[] = [];
    const opened = await openCtHere(dicomFolder(SLICES), (share) => shares.push(share));
    expect(shares.at(-1)).toBe(1);
    const read: number[] = [];
    await opened.read("1", (share) => read.push(share));
    expect(read.at(-1)).toBe(1);
  });

  test("stops when it is cancelled", async () => {
    const cancel = new AbortController();
    const opened = await open(dicomFolder(SLICES));
    await expect(opened.read("1", () => cancel.abort(), cancel.signal)).rejects.toThrow("abort");
  });

  test.each([
    ["rounds halves away from zero", "0.5", "0", [-3, -1, 1, 3], [-2, -1, 1, 2]],
    ["holds values in 16 bits", "100", "0", [-4000, 4000, 0, 1], [-32768, 32767, 0, 100]],
    ["keeps values under air, as the server's reader does in a file", "1", "-1024", [-2000, 0, 1, 2], [-3024, -1024, -1023, -1022]],
  ])("%s", async (_, slope, intercept, stored, expected) => {
    const files = dicomFolder(8, () => ({ rows: 2, columns: 2, values: Int16Array.from(stored), texts: { "00281053": ["DS", slope], "00281052": ["DS", intercept] } }));
    expect([...(await readProposed(files)).values.subarray(0, 4)]).toEqual(expected);
  });

  test("takes the sign from the stored bits alone", async () => {
    const files = dicomFolder(8, () => ({ rows: 1, columns: 2, bitsStored: 12, values: Int16Array.from([0x0fff, 0x17ff]) }));
    expect([...(await readProposed(files)).values.subarray(0, 2)]).toEqual([-1, 0x7ff]);
  });

  test("converts each slice by its own rescale, and says so", async () => {
    const files = dicomFolder(8, (k) => ({ rows: 1, columns: 1, values: Int16Array.from([k]), texts: { "00281052": ["DS", `${-k}`] } }));
    expect((await open(files)).notes).toEqual(["The rescale differs between the slices: each slice is converted to HU by its own."]);
    expect([...(await readProposed(files)).values]).toEqual(Array(8).fill(0));
  });

  test("of a tilted gantry stays sheared", async () => {
    const files = dicomFolder(SLICES, (k) => ({ position: [0, k, 2 * k] }));
    const { grid } = await readProposed(files);
    expect(grid.spacing[2]).toBeCloseTo(Math.sqrt(5), 12);
    expect(grid.directions[2][1]).toBeCloseTo(1 / Math.sqrt(5), 12);
    expect((await open(files)).notes[0]).toMatch(/^The gantry was tilted by -?26\.6 degrees/);
  });
});

describe("a series that is not one even volume is refused", () => {
  test.each<[string, NamedFile[], string]>([
    ["few slices", dicomFolder(7), "the series has 7 slices; a volume needs at least 8"],
    ["a missing slice", dicomFolder(12).filter((_, k) => k !== 5), "1 slice is missing between"],
    ["a gap of two scans", dicomFolder(12, (k) => ({ position: [0, 0, k < 6 ? k : 40 + k] })), "there is no slice for 41 mm"],
    ["doubled slices", [...dicomFolder(9), named(`${SECRET}/scan/IM9999`, dicomSlice(3, { values: new Int16Array(30) }))], "have the same position"],
    ["another size", dicomFolder(9, (k) => (k === 4 ? { rows: 7 } : {})), "in size (5 x 6 instead of 5 x 7)|in size (5 x 7 instead of 5 x 6)"],
    ["no position", dicomFolder(9, withTexts({ "00200032": null })), "has no usable position (ImagePositionPatient)"],
    ["text in the pixels", dicomFolder(9, withTexts({ "00280301": ["CS", "YES"] })), "text burned in"],
    ["MR", dicomFolder(9, withTexts({ "00080060": ["CS", "MR"], "00080016": ["UI", "1.2.840.10008.5.1.4.1.1.4"] })), "its modality is MR, which has no Hounsfield units"],
    ["color", dicomFolder(9, withTexts({ "00280004": ["CS", "RGB"] })), "it is a color image"],
    ["several frames without places", dicomFolder(2, withTexts({ "00280008": ["IS", "20"], "00180050": null })), "its files hold several frames each, without positions"],
    ["a scout", dicomFolder(2, withTexts({ "00080008": ["CS", "ORIGINAL\\PRIMARY\\LOCALIZER"] })), "a localizer (scout view)"],
    ["a stack off its normal", dicomFolder(9, (k) => ({ position: [0, 2 * k, 2 * k] })), "stacked 45.0 degrees off their normal"],
  ])("%s", async (_, files, expected) => {
    const objection = await objectionTo(files);
    expect(expected.split("|").some((words) => objection.includes(words)), objection).toBe(true);
    expect(objection).not.toContain(SECRET);
    expect(objection).not.toMatch(/\n/);
  });

  test("4 GB, with the numbers", async () => {
    const huge = dicomFolder(8, (k) => ({ rows: 20000, columns: 20000, values: Int16Array.of(k) }));
    expect(await objectionTo(huge)).toContain("20000 x 20000 x 8 = 3200000000 voxels (6.0 GiB); the page reads at most 268435456");
  });

  test("truncated pixels, with the file", async () => {
    const files = dicomFolder(SLICES);
    files[4] = named(files[4].path, dicomSlice(4).subarray(0, -20).slice());
    const opened = await open(files);
    await expect(opened.read(opened.proposed!, () => {})).rejects.toThrow("file 6 of the folder (instance number 5) cannot be read: it is truncated or damaged; export the series again");
  });
});

describe("folders hold more than a CT", () => {
  const other = (number: number, texts: SliceOptions["texts"], count: number) =>
    dicomFolder(count, (k) => ({ position: [0, 0, 1.5 * k], texts: { "0020000e": ["UI", `1.2.3.77.50.${number}`], "00200011": ["IS", `${number}`], ...texts } }), `${SECRET}/s${number}`);

  test("other files and copies are left out with a note", async () => {
    const files = dicomFolder(SLICES);
    const opened = await open([...files, named(`${SECRET}/scan/readme.txt`, "hello"), named(`${SECRET}/scan/copy`, dicomSlice(3))]);
    expect(opened.notes).toEqual(["Left out: 1 file that is not DICOM.", "Left out: 1 file with the same bytes as another one."]);
    expect(opened.series[0].slices).toBe(SLICES);
  });

  test("of three series the rule takes the soft one, as the command line does", async () => {
    const opened = await open([...other(3, { "00181210": ["SH", "H60s"] }, 80), ...other(4, { "00181210": ["SH", "H30s"] }, 80), ...other(5, { "00180010": ["LO", "agent"] }, 70)]);
    expect(opened.series.map(({ kernel, slices }) => [kernel, slices])).toEqual([["H60s", 80], ["H30s", 80], ["H30s", 70]]);
    expect(opened.proposed).toBe("2");
    expect(opened.notes).toEqual(["Chosen of 3 CT series of one study: series 4: 80 axial slices, 1.50 mm apart, over 120 mm, soft kernel; not series 3: the chosen series has a softer kernel; series 5: the chosen series has no contrast medium."]);
  });

  test("slices of a small second scan among the others are left out, with a note", async () => {
    const second = dicomFolder(4, (k) => ({ position: [0, 0, 2 * k + 4], values: new Int16Array(30), texts: { "00200012": ["IS", "9"], "00200013": ["IS", `${90 + k}`] } }), `${SECRET}/scan/second`);
    const first = dicomFolder(12, () => ({ texts: { "00200012": ["IS", "8"] } }), `${SECRET}/scan/first`);
    const opened = await open([...second, ...first]);
    expect(opened.notes).toEqual(["Left out: 4 slices of another scan among the others (told apart by acquisition number)."]);
    expect((await opened.read(opened.proposed!, () => {})).values).toEqual(ofSlices(12));
  });

  test("two whole scans in one series are two choices, and the rule takes neither", async () => {
    const scan = (time: string, offset: number) => dicomFolder(SLICES, (k) => ({ position: [0, 0, 2 * k + offset], texts: { "00080022": ["DA", "20200102"], "00080032": ["TM", time] } }), `${SECRET}/scan/${time}`);
    const opened = await open([...scan("101500", 0.5), ...scan("103000.25", 0)]);
    expect(opened.series.map(({ slices, objections }) => [slices, objections])).toEqual([[SLICES, []], [SLICES, []]]);
    expect(opened.proposed).toBeNull();
    expect((await opened.read("2", () => {})).grid.origin).toEqual([0, 0, 0]);
  });

  test("series of one slice each are one scan where they share a frame of reference", async () => {
    const alone = (k: number) => ({ "0020000e": ["UI", `1.2.3.77.6.${k}`], "00200011": ["IS", `${100 + k}`] }) as const;
    const opened = await open(dicomFolder(SLICES, (k) => ({ texts: alone(k) })));
    expect(opened.notes).toEqual([`${SLICES} slices of ${SLICES} series are read as one: they are of one patient, size and orientation, and their places fit.`]);
    expect((await opened.read(opened.proposed!, () => {})).values).toEqual(ofSlices(SLICES));
    const apart = await open(dicomFolder(SLICES, (k) => ({ texts: { ...alone(k), "00100020": ["LO", `${k % 2}`] } })));
    expect(apart.proposed).toBeNull();
  });

  test("series of one study that follow each other are one scan; two reconstructions are not", async () => {
    const halves = (kernel: string) => dicomFolder(2 * SLICES, (k) => (k < SLICES ? {} : { texts: { "0020000e": ["UI", "1.2.3.77.7"], "00200011": ["IS", "3"], "00181210": ["SH", kernel] } }));
    const joined = await open(halves("H30s"));
    expect(joined.series).toHaveLength(1);
    expect((await joined.read(joined.proposed!, () => {})).values).toEqual(ofSlices(2 * SLICES));
    expect((await open(halves("H60s"))).series).toHaveLength(2);
  });

  test("the rule does not choose between patients", async () => {
    const opened = await open([...other(3, {}, 80), ...other(4, { "00100020": ["LO", "another"] }, 80)]);
    expect(opened.proposed).toBeNull();
    expect(opened.notes[0]).toContain("does not choose between patients");
  });

  test("folders below are read where there is no CT in the first", async () => {
    const nested = dicomFolder(SLICES, undefined, `${SECRET}/a/b/c`);
    expect((await readProposed([named(`${SECRET}/autorun.inf`, "x"), ...nested])).values).toEqual(ofSlices(SLICES));
    const below = other(7, {}, 9).map(({ file }, i) => ({ path: `${SECRET}/scan/below/${i}`, file }));
    expect((await open([...dicomFolder(SLICES), ...below])).series).toHaveLength(1);
  });

  test("a damaged file is left out with a note; where it leaves a hole, the series is refused", async () => {
    const whole = dicomFolder(SLICES);
    const damaged = named(`${SECRET}/scan/zz`, dicomSlice(3).subarray(0, 400).slice());
    const opened = await open([...whole, damaged]);
    expect(opened.notes).toEqual(["Left out: 1 truncated or damaged DICOM file; where slices are missing, copy the folder again."]);
    expect(opened.proposed).not.toBeNull();
    const withHole = await open([...whole.filter((_, i) => i !== 4), damaged]);
    expect(withHole.proposed).toBeNull();
    expect(withHole.series.map(({ objections }) => objections.join()).join()).toContain("1 slice is missing between");
  });

  test("a DICOMDIR beside the images is ignored, and alone it is refused", async () => {
    const directory = named(`${SECRET}/scan/DICOMDIR`, dicomSlice(0, { mediaClass: "1.2.840.10008.1.3.10" }));
    expect((await readProposed([directory, ...dicomFolder(SLICES)])).values).toEqual(ofSlices(SLICES));
    await expect(open([directory])).rejects.toThrow("only a directory of images (DICOMDIR), not the images; copy the whole disc");
  });

  test.each([
    ["nothing", [], "the folder is empty"],
    ["no DICOM file", [named("a", "b"), named("c", "d")], "none of the 2 files is a DICOM file"],
    ["too many files", Array.from({ length: 20_001 }, (_, i) => named(`${i}`, "")), "the folder holds 20001 files; at most 20000 are read"],
  ])("%s is refused", async (_, files, message) => expect(open(files)).rejects.toThrow(message));
});

describe("a zip", () => {
  const zipOf = (files: readonly NamedFile[], bytes: readonly Uint8Array[]) => zipSync(Object.fromEntries(files.map(({ path }, i) => [path, bytes[i]])));
  const slices = Array.from({ length: SLICES }, (_, k) => dicomSlice(k));

  test("of a folder is read as the folder", async () => {
    const zip = zipSync({ ...Object.fromEntries(slices.map((bytes, k) => [`scan/${SLICES - k}`, bytes])), "__MACOSX/x": new Uint8Array(3), ".DS_Store": new Uint8Array(3) });
    expect((await readProposed([named("ct.zip", zip.slice())])).values).toEqual(ofSlices(SLICES));
  });

  test.each<[string, Uint8Array, string]>([
    ["cut off", zipOf(dicomFolder(1), slices).subarray(0, 300), "the zip is truncated or damaged"],
    ["with a file outside", zipSync({ "../x": new Uint8Array(3) }), "outside of its folder"],
    ["with a zip", zipSync({ "a/b.zip": new Uint8Array(3) }), "holds another zip"],
    ["without files", zipSync({}), "the zip is empty"],
    ["that unpacks to 500 times its size", zipSync({ a: new Uint8Array(2 ** 27) }), "more than 500 times its size"],
  ])("%s is refused", async (_, bytes, message) => expect(open([named("x.zip", bytes.slice())])).rejects.toThrow(message));
});

describe("compressed by GDCM", () => {
  const folder = mkdtempSync(join(tmpdir(), "tissueform-dicom-"));
  afterAll(() => rmSync(folder, { recursive: true }));

  test.each([["JPEG lossless", "--jpeg"], ["JPEG-LS", "--jpegls"], ["JPEG 2000", "--j2k"], ["run lengths", "--rle"], ["implicit VR", "--implicit"]])("%s gives the same values", async (_, option) => {
    const [rows, columns] = [40, 36];
    const files = Array.from({ length: 8 }, (__, k) => {
      const [plain, packed] = [join(folder, "plain"), join(folder, "packed")];
      writeFileSync(plain, dicomSlice(k, { rows, columns, bitsStored: 16, isSigned: true }));
      execFileSync("gdcmconv", [option, plain, packed]);
      return named(`${k}`, new Uint8Array(readFileSync(packed)));
    });
    const expected = Array.from({ length: 8 }, (__, k) => [...patternOf(rows, columns, k)]).flat();
    expect([...(await readProposed(files)).values]).toEqual(expected);
    const cut = new Uint8Array(await files[2].file.slice(0, files[2].file.size - 100).arrayBuffer());
    files[2] = named("2", cut);
    const opened = await open(files);
    await expect(opened.read("1", () => {})).rejects.toThrow("file 3 of the folder (instance number 3) cannot be read");
  });

  test("a syntax without a decoder is an objection", async () => {
    const bytes = dicomFolder(9).map(({ path }, k) => {
      const slice = dicomSlice(k);
      const at = Buffer.from(slice).indexOf("1.2.840.10008.1.2.1\0");
      slice.set(new TextEncoder().encode("1.2.840.10008.1.2.9"), at);
      return named(path, slice);
    });
    expect(await objectionTo(bytes)).toContain("transfer syntax 1.2.840.10008.1.2.9");
  });
});

describe("identifiers", () => {
  const planted = [SECRET, "19990102", "19640812", "010203", "1.2.3.77"];

  test("are not in what leaves the worker, nor in the file that leaves the page", async () => {
    const opened = await open(dicomFolder(SLICES));
    const volume = await opened.read("1", () => {});
    const nrrd = new Uint8Array(await (await nrrdOf(volume, () => {})).arrayBuffer());
    const header = Buffer.from(nrrd).indexOf("\n\n") + 2;
    const unpacked = gunzipSync(nrrd.subarray(header));
    expect(unpacked).toEqual(Buffer.from(volume.values.buffer));
    const out = [JSON.stringify({ ...opened, grid: volume.grid, kernel: volume.kernel }), Buffer.from(nrrd).toString("latin1"), unpacked.toString("latin1")].join();
    expect(planted.filter((text) => out.includes(text))).toEqual([]);
  });

  test("in the kernel's field are not taken for a kernel", async () => {
    const [{ kernel }] = (await open(dicomFolder(SLICES, withTexts({ "00181210": ["SH", `${SECRET}^Erika*1964`] })))).series;
    expect(kernel).toBe("");
  });

  test("may be drawn into derived images, which a note says", async () => {
    const { notes } = await open(dicomFolder(SLICES, withTexts({ "00080008": ["CS", "DERIVED\\SECONDARY\\AXIAL"] })));
    expect(notes.join()).toContain("look at the slices for text that names the patient");
  });
});
