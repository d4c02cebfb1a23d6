// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { formatNumber } from "../planning/numbers";
import type { Norm } from "./definitions";
import type { Band, MeasureResult } from "./evaluation";

// Measures in words, the same in the panel and in the report.

/** "5.4 to 6.5"; "" where none is known. */
export function bandText(band: Band | null): string {
  return band === null ? "" : `${formatNumber(band.lowest)} to ${formatNumber(band.highest)}`;
}

/** What is in doubt: "surgery, model and material". */
export function intervalOf({ parts }: Band): string {
  if (parts === undefined) return "material";
  return parts.material === null ? "surgery and model" : "surgery, model and material";
}

/** How wide each part alone is: "of this surgery 1.5, model 0.8, material 0.03"; "" where it is the material alone. */
export function partsText(band: Band | null): string {
  if (band?.parts === undefined) return "";
  const { surgery, model, material } = band.parts;
  return [`of this surgery ${formatNumber(surgery)}`, ...(model === 0 ? [] : [`model ${formatNumber(model)}`]), ...(material === null ? [] : [`material ${formatNumber(material, 2)}`])].join(", ");
}

/** Half the interval: "± 1.7"; "" where none is known. */
export function plusMinus(band: Band | null): string {
  return band === null ? "" : `± ${formatNumber((band.highest - band.lowest) / 2)}`;
}

/** What whole bands say, below `where`. */
export function wholeBandText(where: string, bands: Iterable<Band>): string {
  const parts = Array.from(bands).flatMap((band) => band.parts ?? []);
  const hasMaterial = parts.some(({ material }) => material !== null);
  return `Below ${where}: where 95 of 100 patients will be if surgery and model err as ${parts[0]?.source ?? "published"}${hasMaterial ? ", and the material as the case states" : ""}.`;
}

/** Of a length, which is at least 0: "5.4 to 6.5". */
export function lengthBand(valueMm: number, bandMm: number): string {
  return bandText({ lowest: Math.max(0, valueMm - bandMm), highest: valueMm + bandMm });
}

/** "102 ± 8, Legan and Burstone 1980" */
export function normText(norm: Norm | null): string {
  if (norm === null) return "";
  return `norm ${formatNumber(norm.mean, 0)}${norm.deviation === null ? "" : ` ± ${formatNumber(norm.deviation, 0)}`}, ${norm.source}`;
}

export function unitText({ definition }: MeasureResult): string {
  return definition.unit === "mm" ? "mm" : "°";
}

/** Why there is no number; "" where there is one. `label` of a landmark's name. */
export function whyNot(result: MeasureResult, label: (name: string) => string): string {
  if (result.kind === "missing") return `needs ${result.landmarks.map(label).join(", ")}`;
  return result.kind === "impossible" ? result.text : "";
}

/** Before, after, difference; empty without a value. */
export function valueTexts(result: MeasureResult): [string, string, string] {
  if (result.kind !== "value") return ["", "", ""];
  const { before, after } = result;
  return [formatNumber(before), formatNumber(after), formatNumber(after - before)];
}
