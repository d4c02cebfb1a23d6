// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { add, cross, dot, norm, scaled, subtract, type Vector } from "../geometry/rotation";
import { nameOf, normalOf, type DicomHeader } from "./dicom_header";
import { MAX_POSITION_MM, upperMedian } from "./series_facts";
import type { Grid } from "./volume";

// As core/imaging/ct/dicom_stack.cc, except that slices off an even grid are not interpolated here.

export const LEAST_SLICES = 8;
/** Of the page: the values of so many voxels take 512 MiB. */
export const MAX_VOXELS = 2 ** 28;
export const ON_COMMAND_LINE = "`tissueform plan build` on the command line";
const SAME_DIRECTION = 1e-3;
const SAME_POSITION_MM = 0.01;
const POSITION_TOLERANCE_MM = 0.1;
const LEAST_SPACING_MM = 0.05;
const MAX_SPACING_MM = 10;
const MAX_GAP_MM = 30;
const MAX_TILT_DEG = 35;
const UPRIGHT_DEG = 0.05;

/** Slices in the order in which they are stacked, along their normal. */
export interface SliceStack {
  readonly slices: readonly DicomHeader[];
  readonly grid: Grid;
  readonly notes: readonly string[];
}

function checkTags(slices: readonly DicomHeader[]): void {
  const someState = slices.some((slice) => slice.slope !== null || slice.intercept !== null);
  for (const slice of slices) {
    const missing = slice.position === null || slice.position.some((x) => Math.abs(x) > MAX_POSITION_MM) ? "position (ImagePositionPatient)"
      : slice.axes === null ? "orientation (ImageOrientationPatient)"
      : slice.pixelSpacing === null ? "pixel spacing (PixelSpacing)" : "";
    if (missing !== "") throw new Error(`${nameOf(slice)} has no usable ${missing}: its position is unknown`);
    if (someState && (slice.intercept === null || slice.slope === 0)) {
      throw new Error(`${nameOf(slice)} has no calibration to HU (RescaleSlope, RescaleIntercept); export the series again`);
    }
  }
}

function haveSameAxes(a: DicomHeader, b: DicomHeader): boolean {
  return [0, 1].every((i) => norm(subtract(a.axes![i], b.axes![i])) <= SAME_DIRECTION);
}

function haveSameSpacing([a0, a1]: readonly [number, number], [b0, b1]: readonly [number, number]): boolean {
  return Math.hypot(a0 - b0, a1 - b1) <= SAME_DIRECTION * Math.min(Math.hypot(a0, a1), Math.hypot(b0, b1));
}

/** Whether two slices could be of one volume. REQUIRES: checkTags. */
export function areAlike(a: DicomHeader, b: DicomHeader): boolean {
  return a.patient === b.patient && a.rows === b.rows && a.columns === b.columns && haveSameAxes(a, b) && haveSameSpacing(a.pixelSpacing!, b.pixelSpacing!) &&
    a.slope === b.slope && a.intercept === b.intercept && a.patientPosition === b.patientPosition;
}

function checkAlike(slices: readonly DicomHeader[]): void {
  const first = slices[0];
  for (const slice of slices) {
    const what = slice.rows !== first.rows || slice.columns !== first.columns ? `size (${slice.columns} x ${slice.rows} instead of ${first.columns} x ${first.rows})`
      : !haveSameAxes(slice, first) ? "orientation"
      : !haveSameSpacing(slice.pixelSpacing!, first.pixelSpacing!) ? "pixel spacing" : "";
    if (what !== "") throw new Error(`${nameOf(slice)} differs from ${nameOf(first)} in ${what}: they are not one volume`);
  }
}

function checkPlane(slice: DicomHeader): void {
  const [row, column] = slice.axes!;
  if (Math.abs(norm(row) - 1) > SAME_DIRECTION || Math.abs(norm(column) - 1) > SAME_DIRECTION || Math.abs(dot(row, column)) > SAME_DIRECTION) {
    throw new Error(`${nameOf(slice)} has an orientation that is not two directions square to each other`);
  }
  const [rows, columns] = slice.pixelSpacing!;
  if (!(Math.min(rows, columns) >= LEAST_SPACING_MM && Math.max(rows, columns) <= MAX_SPACING_MM)) {
    throw new Error(`${nameOf(slice)} has pixels of ${columns} x ${rows} mm; between ${LEAST_SPACING_MM} and ${MAX_SPACING_MM} mm are read`);
  }
}

function checkGaps(slices: readonly DicomHeader[], gaps: readonly number[]): void {
  const doubled = gaps.findIndex((gap) => gap < SAME_POSITION_MM);
  if (doubled >= 0) {
    throw new Error(`${nameOf(slices[doubled])} and ${nameOf(slices[doubled + 1])} have the same position: keep only the files of one scan in the folder; ${ON_COMMAND_LINE} separates two scans that the headers distinguish`);
  }
  const wide = gaps.findIndex((gap) => gap > MAX_GAP_MM);
  if (wide >= 0) {
    throw new Error(`there is no slice for ${gaps[wide].toFixed(0)} mm between ${nameOf(slices[wide])} and ${nameOf(slices[wide + 1])}: leave the files of one scan in the folder`);
  }
}

/** Each gap may be even within the tolerance and all of them drift: so every slice is held against the line from the first to the last, too. */
function isEven(slices: readonly DicomHeader[], gaps: readonly number[], step: Vector): boolean {
  const usual = upperMedian(gaps);
  return slices.every((slice, i) => norm(subtract(slice.position!, add(slices[0].position!, scaled(step, i)))) <= POSITION_TOLERANCE_MM &&
    (i === 0 || Math.abs(gaps[i - 1] - usual) <= POSITION_TOLERANCE_MM));
}

function missingSlices(slices: readonly DicomHeader[], gaps: readonly number[]): string {
  const usual = upperMedian(gaps);
  for (let i = 0; i < gaps.length; ++i) {
    const missing = Math.round(gaps[i] / usual) - 1;
    if (missing < 1 || Math.abs(gaps[i] - (missing + 1) * usual) > POSITION_TOLERANCE_MM) continue;
    if (i + 1 < gaps.length && Math.abs(gaps[i + 1] - gaps[i]) < POSITION_TOLERANCE_MM) return "";
    return `; ${missing} slice${missing > 1 ? "s are" : " is"} missing between ${nameOf(slices[i])} and ${nameOf(slices[i + 1])}`;
  }
  return "";
}

function uneven(slices: readonly DicomHeader[], gaps: readonly number[]): Error {
  const [least, most] = [Math.min(...gaps), Math.max(...gaps)].map((gap) => gap.toFixed(2));
  return new Error(`the slices are unevenly spaced, ${least} to ${most} mm apart, usually ${upperMedian(gaps).toFixed(2)} mm${missingSlices(slices, gaps)}: add the missing files, or use ${ON_COMMAND_LINE}, which interpolates between uneven slices`);
}

function checkStep(step: Vector, normal: Vector): void {
  if (!(norm(step) >= LEAST_SPACING_MM && norm(step) <= MAX_SPACING_MM)) {
    throw new Error(`the slices are ${norm(step).toFixed(3)} mm apart; between ${LEAST_SPACING_MM.toFixed(2)} and ${MAX_SPACING_MM} mm are read`);
  }
  const angle = (Math.acos(Math.min(1, dot(step, normal) / norm(step))) * 180) / Math.PI;
  if (angle > MAX_TILT_DEG) throw new Error(`the slices are stacked ${angle.toFixed(1)} degrees off their normal, which no gantry tilt explains`);
}

function notesOf(slices: readonly DicomHeader[], row: Vector, normal: Vector, step: Vector): string[] {
  const notes: string[] = [];
  if (new Set(slices.map((slice) => `${slice.slope}|${slice.intercept}`)).size > 1) {
    notes.push("The rescale differs between the slices: each slice is converted to HU by its own.");
  }
  if (slices[0].intercept === null) notes.push("The files state no calibration to HU: the server decides whether their values are HU or gray values.");
  const tilt = (Math.atan2(dot(row, cross(step, normal)), dot(step, normal)) * 180) / Math.PI;
  if (Math.abs(tilt) >= UPRIGHT_DEG) notes.push(`The gantry was tilted by ${tilt.toFixed(1)} degrees: the slices are kept as they are, and the plan is upright.`);
  const lossy = slices.filter((slice) => slice.wasLossy).length;
  if (lossy > 0) notes.push(`${lossy} slices were once compressed with loss.`);
  return notes;
}

/** Sorts the slices of a series and finds their grid. Throws with one line for what is not one even volume, naming the file. */
export function arrangeStack(given: readonly DicomHeader[]): SliceStack {
  checkTags(given);
  checkAlike(given);
  checkPlane(given[0]);
  if (given.length < LEAST_SLICES) throw new Error(`the series has ${given.length} slices; a volume needs at least ${LEAST_SLICES}`);
  const [row, column] = given[0].axes!.map((axis) => scaled(axis, 1 / norm(axis)));
  const normal = normalOf([row, column]);
  const height = (slice: DicomHeader) => dot(slice.position!, normal);
  const slices = [...given].sort((a, b) => height(a) - height(b) || a.fileNumber - b.fileNumber);
  const gaps = slices.slice(1).map((slice, i) => height(slice) - height(slices[i]));
  const step = scaled(subtract(slices[slices.length - 1].position!, slices[0].position!), 1 / (slices.length - 1));
  checkGaps(slices, gaps);
  if (!isEven(slices, gaps, step)) throw uneven(slices, gaps);
  checkStep(step, normal);
  const size: Grid["size"] = [slices[0].columns, slices[0].rows, slices.length];
  checkSize(size);
  const [betweenRows, betweenColumns] = slices[0].pixelSpacing!;
  const grid: Grid = { size, spacing: [betweenColumns, betweenRows, norm(step)], origin: slices[0].position!, directions: [row, column, scaled(step, 1 / norm(step))] };
  return { slices, grid, notes: notesOf(slices, row, normal, step) };
}

/** Throws where the page cannot hold so many voxels. */
export function checkSize(size: readonly [number, number, number]): void {
  const voxels = size[0] * size[1] * size[2];
  if (voxels <= MAX_VOXELS) return;
  throw new Error(`the volume has ${size.join(" x ")} = ${voxels} voxels (${((voxels * 2) / 2 ** 30).toFixed(1)} GiB); the page reads at most ${MAX_VOXELS}: crop it to the head, or use ${ON_COMMAND_LINE}, which reads up to ${2 ** 30}`);
}
