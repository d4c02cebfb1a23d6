// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { readFileSync } from "node:fs";
import { fileURLToPath } from "node:url";
import { describe, expect, test } from "vitest";
import { packRows, unpackRows } from "../../src/movingdata/integer_rows";
import { readMovingData, writeMovingData } from "../../src/movingdata/moving_data";

// Written by C++: tests/client/cli/export/moving_data_test.cc.
const golden = () => new Uint8Array(readFileSync(fileURLToPath(new URL("../../../../tests/data/moving_file/small.bin", import.meta.url))));

/** Where the JSON ends and the parts begin. */
function jsonOf(bytes: Uint8Array): { json: unknown; parts: Uint8Array } {
  const length = new DataView(bytes.buffer, bytes.byteOffset).getUint32(12, true);
  return { json: JSON.parse(new TextDecoder().decode(bytes.subarray(16, 16 + length))), parts: bytes.subarray(16 * Math.ceil((16 + length) / 16)) };
}

describe("rows of whole numbers", () => {
  test("come back as they were", () => {
    const rows = Int32Array.from([0, -1, 2 ** 30, 5, -(2 ** 30), 7, 1 << 20, 3, -9]);
    expect(unpackRows(packRows(rows), 3)).toEqual(rows);
    expect(unpackRows(packRows(rows), 2)).toBe(null);
  });

  test("have all high bytes zero where they change little", () => {
    const packed = packRows(Int32Array.from({ length: 300 }, (_, i) => 100_000 + Math.floor(i / 3)));
    expect(packed.subarray(900).every((byte) => byte === 0)).toBe(true);
    expect(packed.subarray(300, 600).filter((byte) => byte !== 0).length).toBe(3);
  });
});

describe("data of a file that moves", () => {
  test("are read as tissueform export has written them", () => {
    const data = readMovingData(golden());
    expect(data).toMatchObject({ title: "", software: "tissueform test", model: "linear_elastic" });
    expect(data.handles.map(({ name, isFree }) => [name, isFree])).toEqual([["mandible", true], ["maxilla", false]]);
    expect(data.handles[0].pose.translationMm).toEqual([0, -8, 0.25]);
    expect(data.handles[0].limits).toEqual({ translationMm: 15, rotationDeg: 20 });
    expect(data.surfaces.map(({ kind, handle }) => [kind, handle])).toEqual([["skin", ""], ["segment", "mandible"]]);
    const [skin, segment] = data.surfaces;
    const expected = [0, 0, 0, 10.25, -7.125, 0.00024, -120.3, 3e-4, -0.00024, 99.9, -99.9, 1.5];
    skin.positions.forEach((value, i) => expect(Math.abs(value - expected[i])).toBeLessThanOrEqual(0.5 / 2048 + 1e-5));
    expect(Array.from(skin.triangles)).toEqual([0, 1, 2, 2, 1, 3]);
    expect(Array.from(skin.follows?.places ?? [])).toEqual([1, 0, 2, 0, 0, 0, 3, 2, 0, 0, 0, 0]);
    expect(skin.follows?.weights[1]).toBeCloseTo(0.5, 4);
    expect(segment.follows).toBe(null);
    expect(new TextDecoder().decode(data.answers)).toBe("answer");
  });

  test("are written as tissueform export writes them", () => {
    const ours = jsonOf(writeMovingData(readMovingData(golden())));
    const theirs = jsonOf(golden());
    expect(ours.json).toEqual(theirs.json);
    expect(ours.parts).toEqual(theirs.parts);
  });

  test("are rounded as tissueform export rounds them", () => {
    const data = readMovingData(golden());
    // Halves of a step go up, above zero and below it; as the C++ test has them.
    data.surfaces[0].positions = Float32Array.from([0, 0, 0, 10.25, -7.125, 0.000244140625, -120.3, 3e-4, -0.000244140625, 99.9, -99.9, 1.5]);
    data.surfaces[0].follows = { places: data.surfaces[0].follows?.places ?? new Uint32Array(), weights: Float32Array.from([0.25, 0.5, 0.25, 1, 0, 0, 0.3, 0.3, 0, 0, 0, 0]) };
    expect(jsonOf(writeMovingData(data)).parts).toEqual(jsonOf(golden()).parts);
  });

  test("whatever is cut off or changed in them is refused, and nothing hangs", () => {
    const whole = golden();
    for (let length = 0; length < whole.length - 16; length += 13) expect(() => readMovingData(whole.slice(0, length))).toThrow();
    for (let at = 0; at < whole.length; at += 7) {
      const changed = whole.slice();
      changed[at] ^= 0xff;
      try {
        const { surfaces } = readMovingData(changed);
        for (const { positions, triangles } of surfaces) expect(triangles.every((vertex) => vertex < positions.length / 3)).toBe(true);
      } catch (thrown) {
        expect(thrown).toBeInstanceOf(Error);
      }
    }
  });
});
