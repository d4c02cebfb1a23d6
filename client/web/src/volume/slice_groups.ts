// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { dot } from "../geometry/rotation";
import { normalOf, type DicomHeader } from "./dicom_header";
import { upperMedian } from "./series_facts";
import { areAlike, LEAST_SLICES } from "./slice_stack";

// Groups that are one CT although their files name several series, joined as core/imaging/ct/slice_groups.h says it.

/** Objects that their headers, or the page, take for one series. */
export interface SliceGroup {
  readonly objects: readonly DicomHeader[];
  /** That were joined. */
  readonly series: number;
}

type Fits = (a: SliceGroup, b: SliceGroup) => boolean;

/** Between two series that follow each other: this much of their larger usual distance. */
const LONGEST_STEP = 1.5;

const firstOf = ({ objects }: SliceGroup) => objects[0];
const isWhole = ({ objects }: SliceGroup) => objects.length >= LEAST_SLICES;
const hasPlace = ({ kind, position, axes, pixelSpacing }: DicomHeader) => kind === "ct slice" && position !== null && axes !== null && pixelSpacing !== null;

/** A group that is not of one kind stays alone: arrangeStack says what differs. */
function isUniform(group: SliceGroup): boolean {
  return hasPlace(firstOf(group)) && group.objects.every((slice) => hasPlace(slice) && areAlike(slice, firstOf(group)));
}

const areOfOneImage: Fits = (a, b) => areAlike(firstOf(a), firstOf(b)) && firstOf(a).reconstruction === firstOf(b).reconstruction;
const shareFrame: Fits = (a, b) => firstOf(a).frameUid !== "" && firstOf(a).frameUid === firstOf(b).frameUid;

const followEachOther: Fits = (a, b) => {
  const normal = normalOf(firstOf(a).axes!);
  const heightsOf = ({ objects }: SliceGroup) => objects.map(({ position }) => dot(position!, normal)).sort((low, high) => low - high);
  const stepOf = (heights: readonly number[]) => upperMedian(heights.slice(1).map((height, i) => height - heights[i]));
  const [ofA, ofB] = [heightsOf(a), heightsOf(b)];
  const betweenMm = Math.max(ofB[0] - ofA[ofA.length - 1], ofA[0] - ofB[ofB.length - 1]);
  return betweenMm > 0 && betweenMm <= LONGEST_STEP * Math.max(stepOf(ofA), stepOf(ofB));
};

const joined = (a: SliceGroup, b: SliceGroup): SliceGroup => ({ objects: [...a.objects, ...b.objects], series: a.series + b.series });

/** Puts each group into the first of those before it that it fits, again and again until none does. */
function joinThoseThat(fit: Fits, groups: readonly SliceGroup[]): SliceGroup[] {
  const out: SliceGroup[] = [];
  for (const group of groups) {
    const into = out.findIndex((other) => fit(other, group));
    if (into < 0) out.push(group);
    else out[into] = joined(out[into], group);
  }
  return out.length < groups.length ? joinThoseThat(fit, out) : out;
}

/** A fragment that fits several whole groups (two phases) may belong to any of them: it stays alone. */
function addFragments(whole: SliceGroup[], fragments: readonly SliceGroup[]): SliceGroup[] {
  return fragments.filter((fragment) => {
    const homes = whole.flatMap((group, index) => (areOfOneImage(group, fragment) && shareFrame(group, fragment) ? [index] : []));
    if (homes.length === 1) whole[homes[0]] = joined(whole[homes[0]], fragment);
    return homes.length !== 1;
  });
}

function joinAsTheyFit(groups: readonly SliceGroup[]): SliceGroup[] {
  const whole = joinThoseThat((a, b) => areOfOneImage(a, b) && shareFrame(a, b) && firstOf(a).studyUid === firstOf(b).studyUid && followEachOther(a, b), groups.filter(isWhole));
  const left = addFragments(whole, groups.filter((group) => !isWhole(group)));
  const ofFrames = joinThoseThat((a, b) => areOfOneImage(a, b) && shareFrame(a, b), left);
  const torn = joinThoseThat(areOfOneImage, ofFrames.filter((group) => !isWhole(group)));
  return [...torn, ...whole, ...ofFrames.filter(isWhole)];
}

const byFile = (a: DicomHeader, b: DicomHeader) => a.fileNumber - b.fileNumber || a.frame - b.frame;

/** Identifiers of series are random: numbers and names of files give the order. */
export function byNumber(a: SliceGroup, b: SliceGroup): number {
  const [numberA, numberB] = [a, b].map((group) => firstOf(group).seriesNumber ?? -Infinity);
  return numberA === numberB ? byFile(firstOf(a), firstOf(b)) : numberA - numberB;
}

/** REQUIRES: each group has an object. */
export function joinGroups(groups: readonly SliceGroup[]): SliceGroup[] {
  const uniform = joinAsTheyFit(groups.filter(isUniform)).map(({ objects, series }) => ({ objects: [...objects].sort(byFile), series }));
  return [...groups.filter((group) => !isUniform(group)), ...uniform].sort(byNumber);
}
