// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { CaseFile } from "../case/case_file";
import { VIRIDIS, colorTable, colorize, roundUp } from "../geometry/color_map";
import type { Head } from "../scene/head";

/** What the colours of a map say. */
export interface MapLegend {
  title: string;
  /** The map's last colour and all beyond it, in mm. */
  mostMm: number;
  /** The largest value on the face, in mm. */
  largestMm: number;
}

const TABLE = colorTable(VIRIDIS);

/** Lays numbers of mm upon the skin as colours. */
export class FaceColors {
  private readonly values: Float32Array[];
  private readonly colors: Uint8Array[];
  private isColored = false;

  constructor(private readonly head: Head) {
    this.values = head.skins.map((skin) => new Float32Array(skin.source.positions.length / 3));
    this.colors = head.skins.map((skin) => new Uint8Array(skin.source.positions.length));
  }

  /** The colour of skin. */
  clear(): void {
    if (this.isColored) this.head.colorSkin(null);
    this.isColored = false;
  }

  /** Lengths of `vectors`, three of each of CaseFile.followed. */
  showLengths(title: string, vectors: Float32Array): MapLegend {
    this.head.skins.forEach((skin, index) => skin.shape.spreadLengths(vectors, this.values[index]));
    return this.show(title);
  }

  /** One of each of CaseFile.followed. */
  showNumbers(title: string, numbers: Float32Array): MapLegend {
    this.head.skins.forEach((skin, index) => skin.shape.spread(numbers, this.values[index]));
    return this.show(title);
  }

  private show(title: string): MapLegend {
    let largestMm = 0;
    for (const values of this.values) {
      for (const value of values) if (value > largestMm) largestMm = value;
    }
    const mostMm = roundUp(largestMm);
    this.values.forEach((values, index) => colorize(values, mostMm, TABLE, this.colors[index]));
    this.head.colorSkin(this.colors);
    this.isColored = true;
    return { title, mostMm, largestMm };
  }
}

/** Rest positions of CaseFile.followed, three each. */
export function followedRest(file: CaseFile): Float32Array {
  return pick(file.restPositions, file.followed);
}

/** Rows of three of `source`, those of `rows`. */
export function pick(source: Float32Array, rows: ArrayLike<number>): Float32Array {
  const out = new Float32Array(3 * rows.length);
  for (let i = 0; i < rows.length; ++i) {
    out[3 * i] = source[3 * rows[i]];
    out[3 * i + 1] = source[3 * rows[i] + 1];
    out[3 * i + 2] = source[3 * rows[i] + 2];
  }
  return out;
}

/** out = a - b. */
export function subtractInto(a: Float32Array, b: Float32Array, out: Float32Array): Float32Array {
  for (let i = 0; i < out.length; ++i) out[i] = a[i] - b[i];
  return out;
}

/** a at share 0, b at share 1. */
export function mix(a: Float32Array, b: Float32Array, share: number): Float32Array {
  return a.map((value, i) => value + share * (b[i] - value));
}
