// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

// Numbers as people type and read them.

export type Unit = "mm" | "°";

/**
 * "8", "-1.5", "+2,25 mm", "3 deg": a number with the unit or without it, point or comma before the decimals. Null: none.
 */
export function parseNumber(text: string, unit: Unit): number | null {
  const units = unit === "mm" ? "mm" : "°|deg|degrees?";
  const match = new RegExp(`^\\s*([+\\-−]?(?:\\d+(?:[.,]\\d*)?|[.,]\\d+))\\s*(?:${units})?\\s*$`, "i").exec(text);
  if (match === null) return null;
  const number = Number(match[1].replace("−", "-").replace(",", "."));
  return Number.isFinite(number) ? number : null;
}

/** With a sign that is a minus, never "-0.0"; a tenth by default. */
export function formatNumber(value: number, decimals = 1): string {
  const text = value.toFixed(decimals);
  return Number(text) === 0 ? (0).toFixed(decimals) : text.replace("-", "−");
}

export function formatWithUnit(value: number, unit: Unit, decimals = 1): string {
  return unit === "mm" ? `${formatNumber(value, decimals)} mm` : `${formatNumber(value, decimals)}°`;
}

/** "8.0 mm forward", "2.5 mm back": a direction of two names, "" for nothing. */
export function formatDirection(value: number, positive: string, negative: string): string {
  if (Number(value.toFixed(1)) === 0) return "";
  return `${Math.abs(value).toFixed(1)} mm ${value > 0 ? positive : negative}`;
}

/** "1.2 MB" */
export function formatBytes(count: number): string {
  if (count < 1e3) return `${count} bytes`;
  return count < 1e6 ? `${(count / 1e3).toFixed(0)} kB` : `${(count / 1e6).toFixed(1)} MB`;
}

/** "1.2 of 5.0 MB, 24 %" */
export function formatProgress(doneBytes: number, totalBytes: number): string {
  return `${(doneBytes / 1e6).toFixed(1)} of ${(totalBytes / 1e6).toFixed(1)} MB, ${Math.floor((100 * doneBytes) / totalBytes)} %`;
}
