// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Volume } from "../volume/volume";
import { OUTSIDE } from "./sampling";

/** The values from center - width / 2 (black) to center + width / 2 (white): HU, or gray values of a cone-beam CT. */
export interface Window {
  readonly center: number;
  readonly width: number;
}

export const PRESETS: readonly { label: string; window: Window }[] = [
  { label: "Bone", window: { center: 400, width: 1800 } },
  { label: "Soft tissue", window: { center: 40, width: 400 } },
  { label: "Teeth, implants", window: { center: 1300, width: 3600 } },
  { label: "Skin", window: { center: -300, width: 800 } },
];

const MIN_WIDTH = 2;
const SAMPLES = 20_000;

/** Wider by a factor, and with the center shifted by a part of the width, as a drag does it. */
export function changedWindow({ center, width }: Window, factor: number, shift: number): Window {
  return { center: Math.max(-32768, Math.min(32767, center + shift * width)), width: Math.max(MIN_WIDTH, Math.min(65535, width * factor)) };
}

/** From the 1st to the 99.5th percentile, for volumes whose values are not HU. */
export function wholeRange({ values }: Volume): Window {
  const step = Math.max(1, Math.floor(values.length / SAMPLES));
  const sorted = Int16Array.from({ length: Math.floor(values.length / step) }, (_, i) => values[i * step]).sort();
  const [low, high] = [sorted[Math.floor(0.01 * sorted.length)], sorted[Math.floor(0.995 * (sorted.length - 1))]];
  return { center: (low + high) / 2, width: Math.max(MIN_WIDTH, high - low) };
}

/** The gray of each value plus 32768. What is outside the grid is black. */
export function grayTable({ center, width }: Window): Uint8Array {
  const table = new Uint8ClampedArray(65536);
  for (let i = 0; i < 65536; ++i) table[i] = (255 * (i - 32768 - center + width / 2)) / width;
  table[OUTSIDE + 32768] = 0;
  return new Uint8Array(table.buffer);
}
