// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { execFileSync } from "node:child_process";
import { existsSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { gunzipSync } from "node:zlib";
import type { Page } from "playwright-core";
import puppeteer, { type Browser as Firefox } from "puppeteer-core";
import { dicomSlice, patternOf, SECRET } from "../../client/web/tests/volume/dicom_writer";
import { readInPage, refusalInPage, type VolumeHook } from "./ct_input";
import { openPage, Planner } from "./planner";

// A folder of DICOM files through the worker, with the page's content security policy, in two browsers.

const FIREFOX = process.env.TISSUEFORM_FIREFOX ?? "/usr/bin/firefox-esr";
const SLICES = 9;
const [ROWS, COLUMNS] = [40, 36];
const folder = mkdtempSync(join(tmpdir(), "tissueform-ct-"));

/** GDCM's option: how it is compressed. */
function slicesAs(option: string): { path: string; base64: string }[] {
  return Array.from({ length: SLICES }, (_, k) => {
    const [plain, packed] = [join(folder, "plain"), join(folder, "packed")];
    writeFileSync(plain, dicomSlice(k, { rows: ROWS, columns: COLUMNS }));
    execFileSync("gdcmconv", [option, plain, packed]);
    return { path: `${SECRET}/${SLICES - k}`, base64: readFileSync(packed).toString("base64") };
  });
}

const expected = Array.from({ length: SLICES }, (_, k) => [...patternOf(ROWS, COLUMNS, k)]).flat();
const COMPRESSIONS = [["uncompressed", "--raw"], ["JPEG lossless", "--jpeg"], ["JPEG-LS", "--jpegls"], ["JPEG 2000", "--j2k"], ["run lengths", "--rle"]] as const;

let planner: Planner;
beforeAll(async () => (planner = await Planner.start()));
afterAll(async () => {
  rmSync(folder, { recursive: true });
  await planner?.stop();
});

function expectRead({ grid, values, nrrd, series, notes }: Awaited<ReturnType<typeof readInPage>>): void {
  expect(grid).toEqual({ size: [COLUMNS, ROWS, SLICES], spacing: [0.25, 0.5, 2], origin: [-10, -20, 0], directions: [[1, 0, 0], [0, 1, 0], [0, 0, 1]] });
  expect(values).toEqual(expected);
  const file = Buffer.from(nrrd);
  const unpacked = gunzipSync(file.subarray(file.indexOf("\n\n") + 2));
  expect([...new Int16Array(unpacked.buffer, unpacked.byteOffset, unpacked.length / 2)]).toEqual(expected);
  const out = [JSON.stringify({ series, notes }), file.toString("latin1"), unpacked.toString("latin1")].join();
  expect([SECRET, "19990102", "19640812", "1.2.3.77"].filter((text) => out.includes(text))).toEqual([]);
}

describe("in Chromium", () => {
  let opened: { page: Page; faults: string[] };
  const traffic: string[] = [];
  beforeAll(async () => {
    opened = await openPage(await planner.browse(), planner.url);
    opened.page.on("request", (request) => traffic.push(request.url() + JSON.stringify(request.headers()) + (request.postData() ?? "")));
  });
  afterAll(() => opened?.page.context().close());

  test.each(COMPRESSIONS)("a folder of slices, %s, is read with all its values", async (_, option) => {
    expectRead(await opened.page.evaluate(readInPage, slicesAs(option)));
  });

  test("a folder without DICOM is refused with one sentence", async () => {
    const message = await opened.page.evaluate(refusalInPage, [{ path: SECRET, base64: "" }, { path: "a", base64: "" }]);
    expect(message).toBe("none of the 2 files is a DICOM file; drop the folder of the CT series, or one .zip, .nrrd, .nii, .nii.gz or .mha");
  });

  test("reading stops when the user cancels, or closes the CT", async () => {
    const message = await opened.page.evaluate(async (files) => {
      const { openCt } = await (globalThis as unknown as VolumeHook).tissueform.volume();
      const cancel = new AbortController();
      const dropped = files.map(({ path, base64 }) => ({ path, file: new File([Uint8Array.from(atob(base64), (c) => c.charCodeAt(0))], "x") }));
      const ct = await openCt(dropped, () => {});
      const reading = ct.read(ct.proposed!, () => {}, cancel.signal);
      cancel.abort();
      const refused = await reading.then(() => "read", (error: Error) => error.name);
      const again = await ct.read(ct.proposed!, () => {});
      const last = ct.read(ct.proposed!, () => {});
      ct.close();
      return `${refused} ${again.values.length} ${await last.then(() => "read", (error: Error) => error.name)}`;
    }, slicesAs("--raw"));
    expect(message).toBe(`AbortError ${expected.length} AbortError`);
  });

  test("no request held anything of the files, and the policy was kept", () => {
    expect(traffic.some((request) => request.includes("volume_worker"))).toBe(true);
    expect(traffic.filter((request) => [SECRET, "19640812", "1.2.3.77"].some((text) => request.includes(text)))).toEqual([]);
    expect(opened.faults).toEqual([]);
  });
});

const hasFirefox = existsSync(FIREFOX);
if (!hasFirefox) console.warn(`in Firefox: skipped, ${FIREFOX} is not there`);

describe.skipIf(!hasFirefox)("in Firefox", () => {
  let firefox: Firefox;
  beforeAll(async () => (firefox = await puppeteer.launch({ browser: "firefox", executablePath: FIREFOX, headless: true })));
  afterAll(() => firefox?.close());

  test.each(COMPRESSIONS)("a folder of slices, %s, is read with all its values", async (_, option) => {
    const page = await firefox.newPage();
    await page.goto(planner.url);
    await page.waitForFunction(() => "tissueform" in globalThis);
    expectRead(await page.evaluate(readInPage, slicesAs(option)));
    await page.close();
  });
});
