// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

/** A color map as anchors at even distances, sRGB; between them it is linear. */
export interface ColorMap {
  name: string;
  anchors: readonly (readonly [number, number, number])[];
}

function hex(text: string): [number, number, number] {
  return [0, 2, 4].map((at) => parseInt(text.slice(at, at + 2), 16)) as [number, number, number];
}

/** Viridis (van der Walt and Smith): even to the eye, rising in lightness, also for those who see red and green alike. */
export const VIRIDIS: ColorMap = {
  name: "viridis",
  anchors: ["440154", "482475", "414487", "355f8d", "2a788e", "21918c", "22a884", "44bf70", "7ad151", "bddf26", "fde725"].map(hex),
};

const TABLE_SIZE = 256;

/** Three bytes for each of 256 even steps. */
export function colorTable(map: ColorMap): Uint8Array {
  const table = new Uint8Array(3 * TABLE_SIZE);
  const spans = map.anchors.length - 1;
  for (let i = 0; i < TABLE_SIZE; ++i) {
    const at = (i / (TABLE_SIZE - 1)) * spans;
    const span = Math.min(spans - 1, Math.floor(at));
    for (let k = 0; k < 3; ++k) {
      const [from, to] = [map.anchors[span][k], map.anchors[span + 1][k]];
      table[3 * i + k] = Math.round(from + (at - span) * (to - from));
    }
  }
  return table;
}

/** Three bytes for each value: 0 the first color of `table`, `most` and beyond the last one. */
export function colorize(values: Float32Array, most: number, table: Uint8Array, out: Uint8Array): void {
  const factor = most > 0 ? (TABLE_SIZE - 1) / most : 0;
  for (let i = 0; i < values.length; ++i) {
    const step = 3 * Math.max(0, Math.min(TABLE_SIZE - 1, Math.round(values[i] * factor)));
    out[3 * i] = table[step];
    out[3 * i + 1] = table[step + 1];
    out[3 * i + 2] = table[step + 2];
  }
}

const NICE = [1, 1.5, 2, 3, 4, 5, 6, 8, 10];

/** The least round number that is not below `value`; at least 0.1. */
export function roundUp(value: number): number {
  const least = Math.max(value, 0.1);
  const power = 10 ** Math.floor(Math.log10(least));
  const nice = NICE.find((factor) => factor * power >= least - 1e-9) ?? 10;
  return Number((nice * power).toPrecision(3));
}
