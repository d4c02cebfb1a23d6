// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { CaseFile } from "../case/case_file";
import { VIRIDIS, colorTable, colorize, roundUp } from "../geometry/color_map";
import { type LargestMovement, largestMovement, largestOf } from "../geometry/largest_movement";
import type { Head } from "../scene/head";

/** What the colors of a map say. */
export interface MapLegend {
  title: string;
  /** The map's last color and all beyond it, in mm. */
  mostMm: number;
  /** The largest value on the face, in mm. */
  largestMm: number;
  /** Where that stays in 95 of 100 cases, mm; null where it is not known. */
  band: LargestMovement["band"];
}

/** A bar of colors as it is drawn: what stands over it, numbers at its ends and in its middle, and below it. */
export interface ShownLegend {
  title: string;
  ticksMm: readonly [number, number, number];
  note: string;
}

const TABLE = colorTable(VIRIDIS);

/** Lays numbers of mm upon the skin as colors. */
export class FaceColors {
  private readonly values: Float32Array[];
  private readonly bands: Float32Array[];
  private readonly colors: Uint8Array[];
  private isColored = false;

  constructor(private readonly head: Head) {
    this.values = head.skins.map((skin) => new Float32Array(skin.source.positions.length / 3));
    this.bands = this.values.map((values) => new Float32Array(values.length));
    this.colors = head.skins.map((skin) => new Uint8Array(skin.source.positions.length));
  }

  /** The color of skin. */
  clear(): void {
    if (this.isColored) this.head.colorSkin(null);
    this.isColored = false;
  }

  /** Lengths of `vectors`, three of each of CaseFile.followed. `uncertainty`: their band, one of each; null where none is known. */
  showLengths(title: string, vectors: Float32Array, uncertainty: Float32Array | null = null): MapLegend {
    this.head.skins.forEach((skin, index) => {
      skin.shape.spreadLengths(vectors, this.values[index]);
      if (uncertainty !== null) skin.shape.spread(uncertainty, this.bands[index]);
    });
    return this.show(title, uncertainty !== null);
  }

  /** One of each of CaseFile.followed. */
  showNumbers(title: string, numbers: Float32Array): MapLegend {
    this.head.skins.forEach((skin, index) => skin.shape.spread(numbers, this.values[index]));
    return this.show(title, false);
  }

  /** The numbers that were shown last, where the last color stands for `mostMm`: faces side by side have one scale. */
  rescale(mostMm: number): void {
    this.values.forEach((values, index) => colorize(values, mostMm, TABLE, this.colors[index]));
    this.head.colorSkin(this.colors);
    this.isColored = true;
  }

  private show(title: string, hasBand: boolean): MapLegend {
    const { largestMm, band } = largestOf(this.values.map((values, index) => largestMovement(values, hasBand ? this.bands[index] : null)));
    const mostMm = roundUp(largestMm);
    this.rescale(mostMm);
    return { title, mostMm, largestMm, band };
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
