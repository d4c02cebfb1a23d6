// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { dot, norm } from "../geometry/rotation";
import { normalOf, type DicomHeader } from "./dicom_header";
import { areAtOnePlace, fitsInto, isRegular, onRegularSteps, sorted, type Placed, type Stack } from "./regular_slices";

// Scans that lie among each other in one series, distinguished as core/imaging/ct/slice_acquisitions.h describes.

/** Slices that were taken together. */
export interface Acquisition {
  readonly slices: readonly DicomHeader[];
  /** The property that distinguishes it, such as "acquisition time"; empty where there is one only. */
  readonly basis: string;
}

/** Of the slices, for places alone to distinguish scans. */
const MAX_OFF_PLACE = 0.25;
const MAX_SCANS = 8;
/** Interleaved slices of one scan are taken within some seconds. */
const LATER_S = 60;
const SERIES_JUMP_S = 0.5;
const LEAST_JUMP_S = 1;
const MOST_JUMPS = 3;

/** Which part of them each slice belongs to; null: there is one part. */
type Labels = readonly number[] | null;
type Time = "acquisitionTimeS" | "seriesTimeS" | "contentTimeS";

const byLength = (a: Stack, b: Stack) => b.length - a.length;

/** Puts parts together that do not lie among each other, the largest first. */
function assemble(stack: Stack, labels: readonly number[]): Stack[] {
  const parts = new Map<number, Placed[]>();
  for (const placed of stack) {
    const part = parts.get(labels[placed.slice]) ?? [];
    parts.set(labels[placed.slice], part);
    part.push(placed);
  }
  const scans: Stack[] = [];
  for (const [, part] of [...parts].sort(([a, ofA], [b, ofB]) => byLength(ofA, ofB) || a - b)) {
    const home = scans.findIndex((scan) => fitsInto(part, scan));
    if (home < 0) scans.push(part);
    else scans[home] = sorted([...scans[home], ...part]);
  }
  return scans.sort(byLength);
}

/** Numbers for what is equal; none where there is one part, or nearly every slice is one. */
function labelsOf(slices: readonly DicomHeader[], value: (slice: DicomHeader) => string): Labels {
  const numbers = new Map<string, number>();
  const labels = slices.map((slice) => {
    const number = numbers.get(value(slice)) ?? numbers.size;
    numbers.set(value(slice), number);
    return number;
  });
  return numbers.size < 2 || 2 * numbers.size > slices.length ? null : labels;
}

/** Parts between which the time jumps by more than `jumpS`. */
function labelsOfJumps(slices: readonly DicomHeader[], time: Time, jumpS: number): Labels {
  const order = slices.map((slice, index) => ({ at: slice[time], index })).sort((a, b) => (a.at ?? 0) - (b.at ?? 0));
  if (order.some(({ at }) => at === null)) return null;
  const labels = slices.map(() => 0);
  let label = 0;
  order.forEach(({ at, index }, i) => {
    if (i > 0 && at! - order[i - 1].at! > jumpS) label += 1;
    labels[index] = label;
  });
  return label === 0 || label + 1 > MAX_SCANS ? null : labels;
}

/** The jumps of time, largest first, as limits between which parts are counted. */
function largestJumps(slices: readonly DicomHeader[], time: Time): number[] {
  const times = slices.map((slice) => slice[time] ?? 0).sort((a, b) => a - b);
  const jumps = times.slice(1).map((at, i) => at - times[i]).sort((a, b) => b - a);
  return jumps.slice(0, MOST_JUMPS).filter((jump) => jump >= LEAST_JUMP_S).map((jump) => jump - 1e-6);
}

interface Parting {
  readonly scans: readonly Stack[];
  readonly basis: string;
}

/** All properties that may separate scans, in the order in which they are tried. */
function* waysOf(slices: readonly DicomHeader[]): Generator<[Labels, string]> {
  const byTimes = function* (time: Time, basis: string): Generator<[Labels, string]> {
    for (const jumpS of largestJumps(slices, time)) yield [labelsOfJumps(slices, time, jumpS), basis];
  };
  yield [labelsOf(slices, ({ reconstruction }) => reconstruction), "reconstruction (kernel, voltage or phase)"];
  yield [labelsOfJumps(slices, "seriesTimeS", SERIES_JUMP_S), "series time"];
  yield [labelsOf(slices, ({ studyUid }) => studyUid), "study"];
  yield [labelsOf(slices, ({ frameUid }) => frameUid), "frame of reference"];
  yield [labelsOf(slices, ({ seriesUid }) => seriesUid), "series"];
  yield* byTimes("acquisitionTimeS", "acquisition time");
  yield* byTimes("contentTimeS", "content time");
  yield [labelsOf(slices, ({ acquisitionNumber }) => `${acquisitionNumber ?? -1}`), "acquisition number"];
}

/** Positions do not distinguish two slices at one place. */
function partByPlaces(stack: Stack): Parting | null {
  if (stack.some((placed, i) => i > 0 && areAtOnePlace(stack[i - 1], placed))) return null;
  const inIt = onRegularSteps(stack);
  const scans = [true, false].map((isIn) => stack.filter((_, i) => inIt[i] === isIn));
  return scans[1].length > MAX_OFF_PLACE * stack.length ? null : { scans, basis: "place, off the even steps" };
}

function partingOf(slices: readonly DicomHeader[]): Parting | null {
  const normal = normalOf(slices[0].axes!);
  const stack = sorted(slices.map(({ position }, slice) => ({ heightMm: dot(position!, normal), slice })));
  const isInOrder = isRegular(stack);
  const ways: Iterable<[Labels, string]> = isInOrder ? [[labelsOfJumps(slices, "acquisitionTimeS", LATER_S), "acquisition time"]] : waysOf(slices);
  for (const [labels, basis] of ways) {
    if (labels === null) continue;
    const scans = assemble(stack, labels);
    if (scans.length >= 2 && scans.length <= MAX_SCANS && isRegular(scans[0])) return { scans, basis };
  }
  return isInOrder ? null : partByPlaces(stack);
}

function haveHeights(slices: readonly DicomHeader[]): boolean {
  return slices.every(({ position, axes }) => position !== null && axes !== null && norm(axes[0]) < 2 && norm(axes[1]) < 2);
}

/** Slices of one size and orientation by the scans that they are of, the largest first. */
export function separateAcquisitions(slices: readonly DicomHeader[]): Acquisition[] {
  const parting = slices.length > 2 && haveHeights(slices) ? partingOf(slices) : null;
  if (parting === null) return [{ slices, basis: "" }];
  return parting.scans.map((scan) => ({ slices: scan.map(({ slice }) => slices[slice]), basis: parting.basis }));
}
