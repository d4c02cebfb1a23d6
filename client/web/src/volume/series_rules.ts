// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { describeFacts, type SeriesFacts } from "./series_facts";

// The default rule of core/imaging/series/series_rules.h, with its words. It chooses between series; it does not refuse a series that is alone.

const MIN_SLICES = 60;
const MAX_SPACING_MM = 2;
const MAX_THICKNESS_MM = 2.5;
const MIN_COVERAGE_MM = 100;
const MAX_COVERAGE_MM = 600;
const SAME_MM = 0.01;

export interface Pick {
  /** Place of the chosen series among the given ones; -1: none. */
  readonly chosen: number;
  /** One a series: why or why not. */
  readonly reasons: readonly string[];
}

function againstSlices(series: SeriesFacts): string[] {
  if (series.slices < MIN_SLICES) return [`it has ${series.slices} slices, fewer than ${MIN_SLICES}`];
  const against: string[] = [];
  if (series.missing > 0) against.push(`${series.missing} slices are missing between the first and the last`);
  if (series.duplicates > 0) against.push(`${series.duplicates} images have the position of another one`);
  if (series.framesOfReference > 1) against.push(`its images have ${series.framesOfReference} frames of reference`);
  if (series.orientations > 1) against.push("its images have different orientations");
  if (series.plane !== "axial") against.push("its slices are not axial");
  if (series.spacing > MAX_SPACING_MM + SAME_MM) against.push(`its slices are ${series.spacing.toFixed(2)} mm apart, more than ${MAX_SPACING_MM.toFixed(2)}`);
  if (series.thickness > MAX_THICKNESS_MM + SAME_MM) against.push(`its slices are ${series.thickness.toFixed(2)} mm thick, more than ${MAX_THICKNESS_MM.toFixed(2)}`);
  if (series.coverage < MIN_COVERAGE_MM || series.coverage > MAX_COVERAGE_MM) {
    against.push(`it covers ${series.coverage.toFixed(0)} mm, not ${MIN_COVERAGE_MM} to ${MAX_COVERAGE_MM}`);
  }
  return against;
}

export function otherModality(modality: string): string {
  if (modality === "MR") return "its modality is MR, which has no Hounsfield units for bone and skin; choose a CT";
  return `its modality is ${modality === "" ? "unknown" : modality}; choose a CT`;
}

/** All that is against a series; empty: the rule takes it. */
export function whatIsAgainst(series: SeriesFacts): string {
  if (series.isLocalizer) return "it is a localizer (scout)";
  const against: string[] = [];
  if (series.withoutHounsfield > 0) {
    against.push(series.withoutHounsfield < series.images
      ? `${series.withoutHounsfield} of its ${series.images} images have no Hounsfield calibration, the others have one`
      : "it has no Hounsfield calibration, like some cone-beam CTs");
  }
  against.push(...againstSlices(series));
  if (series.isDerived) against.push("it is derived from another series");
  return against.join("; ");
}

const KERNEL_RANK = { soft: 0, unknown: 1, bone: 2 };
/** What is preferred; the first that differs decides. Lower is better. */
const PREFERENCES: readonly (readonly [string, (series: SeriesFacts) => number])[] = [
  ["a softer kernel", (series) => KERNEL_RANK[series.kernel]],
  ["thinner slices", (series) => Math.round(series.spacing / SAME_MM)],
  ["no contrast medium", (series) => (series.hasContrast ? 1 : 0)],
  ["more coverage", (series) => -Math.round(series.coverage)],
  ["a lower number", (series) => series.number],
];

function difference(first: SeriesFacts, second: SeriesFacts): { isBetter: boolean; words: string } {
  const found = PREFERENCES.find(([, rank]) => rank(first) !== rank(second));
  return found === undefined ? { isBetter: false, words: "a lower number" } : { isBetter: found[1](first) < found[1](second), words: found[0] };
}

export function pickSeries(study: readonly SeriesFacts[]): Pick {
  const against = study.map(whatIsAgainst);
  let chosen = -1;
  study.forEach((series, i) => {
    if (against[i] === "" && (chosen < 0 || difference(series, study[chosen]).isBetter)) chosen = i;
  });
  const reasons = study.map((series, i) => {
    if (against[i] !== "") return against[i];
    return i === chosen ? describeFacts(series) : `the chosen series has ${difference(study[chosen], series).words}`;
  });
  return { chosen, reasons };
}
