// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { afterEach, expect, test, vi } from "vitest";
import type { DicomHeader } from "../../src/volume/dicom_header";
import { partsOf, pixelReaders } from "../../src/volume/pixel_readers";

const JPEG_2000 = "1.2.840.10008.1.2.4.90";
const NATIVE = "1.2.840.10008.1.2.1";
const slice = (fileNumber: number, transferSyntax = JPEG_2000, bytes = 1000) => ({ fileNumber, transferSyntax, file: { size: bytes } }) as DicomHeader;

afterEach(() => vi.unstubAllGlobals());

function processors(count: number): { closed: number } {
  const seen = { closed: 0 };
  vi.stubGlobal("navigator", { hardwareConcurrency: count });
  vi.stubGlobal("location", { href: "http://localhost/volume_worker.js" });
  vi.stubGlobal("Worker", class {
    terminate = () => (seen.closed += 1);
  });
  return seen;
}

test("every slice is in one part, and slices of one file follow each other", () => {
  const slices = [7, 3, 5, 3, 9, 1, 3, 8, 2, 2].map((number) => slice(number));
  const parts = partsOf(slices);
  expect(parts.flat().map(({ fileNumber }) => fileNumber)).toEqual([1, 2, 2, 3, 3, 3, 5, 7, 8, 9]);
  expect(new Set(parts.flat()).size).toBe(slices.length);
  expect(Math.max(...parts.map(({ length }) => length))).toBeLessThan(slices.length);
});

test("what is compressed is decoded on all processors, up to eight; the rest is read at once", () => {
  const seen = processors(4);
  const readers = pixelReaders([slice(1)]);
  expect(readers.length).toBe(4);
  readers.forEach((reader) => reader.close());
  expect(seen.closed).toBe(4);
  processors(64);
  expect(pixelReaders([slice(1)]).length).toBe(8);
  expect(pixelReaders([slice(1, NATIVE)]).length).toBe(1);
  processors(1);
  expect(pixelReaders([slice(1)]).length).toBe(1);
});

test("as many large files as fit are held at a time, and one at least", () => {
  processors(8);
  expect(pixelReaders([slice(1, JPEG_2000, 100 * 2 ** 20)]).length).toBe(2);
  expect(pixelReaders([slice(1, JPEG_2000, 2 ** 30)]).length).toBe(1);
});

test("a worker that stops, and one that finds a fault, reject with a sentence", async () => {
  processors(2);
  class FakeWorker {
    onmessage: ((event: unknown) => void) | null = null;
    onerror: (() => void) | null = null;
    postMessage = () => {};
    constructor() {
      workers.push(this);
    }
  }
  const workers: FakeWorker[] = [];
  vi.stubGlobal("Worker", FakeWorker);
  const [reader, other] = pixelReaders([slice(1)]);
  const damaged = reader.read([slice(1)]);
  workers[0].onmessage?.({ data: { error: "slice 3 cannot be read", number: 0 } });
  await expect(damaged).rejects.toThrow("slice 3 cannot be read");
  const stopped = other.read([slice(1)]);
  workers[1].onerror?.();
  await expect(stopped).rejects.toThrow("the reader of the CT stopped; reload the page and try again");
});
