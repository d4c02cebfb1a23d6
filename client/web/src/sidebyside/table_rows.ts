// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { NO_MOVE, fromLps, toMove } from "../geometry/pose";
import { dot, norm, scaled, type Vector } from "../geometry/rotation";
import { landmarkMovements, measureFace } from "../measures/face_measures";
import type { MeasureResult } from "../measures/evaluation";
import type { Norm } from "../measures/definitions";
import { bandText, lengthBand, normText, unitText, valueTexts } from "../measures/texts";
import { describeMovement } from "../planning/landmarks";
import { formatNumber } from "../planning/numbers";
import { MOVE_KEYS } from "../planning/plan";
import { MOVE_TEXTS } from "../panels/segments_panel";
import type { Target } from "../workbench/target_fit";
import { shownMove } from "../workbench/target_place";
import type { ComparedPlan } from "./compared_plan";

/** What of a compared plan the table reads. */
export type TabledPlan = Omit<ComparedPlan, "head" | "colors" | "setActive" | "ask">;

/** A number of one plan. */
export interface Cell {
  text: string;
  /** Below the number: interval, difference. */
  notes: readonly string[];
  /** What is wrong with it; "" where nothing is. */
  warning: string;
}

export interface Row {
  /** Kind and name: its key. */
  id: string;
  title: string;
  note: string;
  preOp: string;
  /** One for each plan; null where the plan has no answer yet. */
  cells: readonly (Cell | null)[];
}

export interface RowGroup {
  title: string;
  rows: readonly Row[];
}

/** What numbers are compared with. */
export interface TableAims {
  /** Null: pre-op. */
  reference: TabledPlan | null;
  targets: readonly Pick<Target, "label" | "place" | "move" | "isAlong">[];
}

/** The server calls a target reached up to here (core/mechanics/plan_fitting/fit_request.h). */
const REACHED_MM = 0.5;
const ZERO = formatNumber(0);

/** All numbers of the plans; groups without rows are left out. `plans`: the planner's own is the first. */
export function tableGroups(plans: readonly TabledPlan[], aims: TableAims): RowGroup[] {
  const groups = [
    { title: "Segments", rows: [...moveRows(plans), ...overlapRow(plans)] },
    { title: "Movements", rows: [largestRow(plans), ...landmarkRows(plans, aims.reference)] },
    { title: "Targets", rows: targetRows(plans, aims.targets) },
    { title: "Measures", rows: measureRows(plans, aims.reference) },
  ];
  return groups.filter(({ rows }) => rows.length > 0);
}

/** How many measures have no number because landmarks are missing. */
export function missingCount(plan: TabledPlan): number {
  return measureFace(plan).filter(({ kind }) => kind === "missing").length;
}

function plain(text: string, notes: readonly string[] = [], warning = ""): Cell {
  return { text, notes: notes.filter((note) => note !== ""), warning };
}

function answered(plans: readonly TabledPlan[], cellOf: (plan: TabledPlan, index: number) => Cell): (Cell | null)[] {
  return plans.map((plan, index) => (plan.isAnswered ? cellOf(plan, index) : null));
}

/** Numbers that are not 0 in all plans, about the pivots of the first: what the planner would show. */
function moveRows(plans: readonly TabledPlan[]): Row[] {
  const { plan: own, file } = plans[0];
  const moves = plans.map(({ plan }) => plan.poses().map((pose, handle) => toMove(pose, own.pivot(handle), file.manifest.headFrame)));
  return own.handles.flatMap((handle, index) =>
    MOVE_KEYS.map((key): Row => {
      const { label, unit } = MOVE_TEXTS[key];
      const texts = moves.map((ofPlan) => formatNumber(ofPlan[index][key]));
      return { id: `move:${handle.name}:${key}`, title: `${handle.label} ${label.toLowerCase()}, ${unit}`, note: "", preOp: formatNumber(NO_MOVE[key]), cells: texts.map((text) => plain(text)) };
    }).filter(({ cells }) => cells.some((cell) => cell?.text !== ZERO)),
  );
}

function overlapRow(plans: readonly TabledPlan[]): Row[] {
  const cells = answered(plans, ({ penetrations: { value } }) => {
    const deepest = value.reduce((most, { depthMm }) => Math.max(most, depthMm), 0);
    // Two pieces overlap from either side.
    const pairs = new Set(value.map(({ segment, other }) => [segment, other].sort().join(" and ")));
    return plain(formatNumber(deepest), [...pairs], deepest > 0 ? "bone overlaps" : "");
  });
  const row = { id: "overlap", title: "Overlap of bone beyond pre-op, mm", note: "", preOp: ZERO, cells };
  return cells.some((cell) => cell !== null && cell.warning !== "") ? [row] : [];
}

function largestRow(plans: readonly TabledPlan[]): Row {
  const cells = answered(plans, (plan) => {
    const { largestMm, band } = plan.largest();
    return plain(formatNumber(largestMm), [band === null ? "" : bandText({ lowest: band.lowestMm, highest: band.highestMm })]);
  });
  return { id: "largest", title: "Largest movement of the skin, mm", note: "", preOp: ZERO, cells };
}

function landmarkRows(plans: readonly TabledPlan[], reference: TabledPlan | null): Row[] {
  const all = plans.map((plan) => (plan.isAnswered ? landmarkMovements(plan) : []));
  const ofReference = reference === null ? undefined : all[plans.indexOf(reference)];
  return plans[0].file.manifest.landmarks.map(({ name, label }, index): Row => {
    const cells = answered(plans, (plan, column) => {
      const { bandMm, ...movement } = all[column][index];
      const other = ofReference?.[index];
      const apart = other === undefined || plan === reference ? "" : `${formatNumber(Math.hypot(movement.forwardMm - other.forwardMm, movement.leftMm - other.leftMm, movement.upMm - other.upMm))} from ${reference?.letter}`;
      const direction = movement.totalMm < 0.05 ? "" : describeMovement(movement);
      const whole = plan.movementBands;
      const material = bandMm === null ? "" : lengthBand(movement.totalMm, bandMm);
      const interval = whole === null ? material : bandText(whole[index]?.totalMm ?? null);
      return plain(formatNumber(movement.totalMm), [direction, interval, apart]);
    });
    return { id: `landmark:${name}`, title: `${label}, mm`, note: "", preOp: ZERO, cells };
  });
}

/** Measures that some plan has a number for, or a reason why not. */
function measureRows(plans: readonly TabledPlan[], reference: TabledPlan | null): Row[] {
  const all = plans.map((plan) => measureFace(plan));
  return all[0].flatMap((first, index): Row[] => {
    if (first.kind === "missing") return [];
    const { definition } = first;
    const other = reference === null || !reference.isAnswered ? null : all[plans.indexOf(reference)][index];
    const cells = answered(plans, (plan, column) => measureCell(plan, all[column][index], reference, other));
    return [{ id: definition.name, title: `${definition.title}, ${unitText(first)}`, note: normText(definition.norm), preOp: valueTexts(first)[0], cells }];
  });
}

function measureCell(plan: TabledPlan, result: MeasureResult, reference: TabledPlan | null, other: MeasureResult | null): Cell {
  if (result.kind !== "value") return plain("–", [result.kind === "impossible" ? result.text : ""]);
  const band = bandText(plan.bands?.get(result.definition.name) ?? result.band);
  return plain(valueTexts(result)[1], [band, differenceText(plan, result, reference, other)], isOutside(result.definition.norm, result.after) ? "outside norm" : "");
}

function differenceText(plan: TabledPlan, result: MeasureResult & { kind: "value" }, reference: TabledPlan | null, other: MeasureResult | null): string {
  if (reference === null) return `${signed(result.after - result.before)} to pre-op`;
  return plan === reference || other?.kind !== "value" ? "" : `${signed(result.after - other.after)} to ${reference.letter}`;
}

function isOutside(norm: Norm | null, value: number): boolean {
  return norm !== null && norm.deviation !== null && Math.abs(value - norm.mean) > norm.deviation;
}

/** "+1.2" */
function signed(value: number): string {
  const text = formatNumber(value);
  return value > 0 && text !== ZERO ? `+${text}` : text;
}

function targetRows(plans: readonly TabledPlan[], targets: TableAims["targets"]): Row[] {
  const { headFrame } = plans[0].file.manifest;
  return targets.map(({ label, place, move, isAlong }, index): Row => {
    const wanted: Vector = [move.forwardMm, move.leftMm, move.upMm];
    const cells = answered(plans, ({ displacements }) => {
      const { forwardMm, leftMm, upMm } = fromLps(shownMove(place, displacements), headFrame);
      const missedMm = distanceMm([wanted[0] - forwardMm, wanted[1] - leftMm, wanted[2] - upMm], isAlong ? wanted : null);
      return plain(formatNumber(missedMm), [missedMm <= REACHED_MM ? "reached" : ""], missedMm > REACHED_MM ? "not reached" : "");
    });
    const note = describeMovement({ label, ...move, totalMm: norm(wanted) });
    return { id: `target:${index}`, title: `${label}, missed by, mm`, note: `target: ${note}`, preOp: formatNumber(norm(wanted)), cells };
  });
}

/** `along`: only along this direction; null: in space. */
function distanceMm(missed: Vector, along: Vector | null): number {
  if (along === null || norm(along) === 0) return norm(missed);
  return Math.abs(dot(missed, scaled(along, 1 / norm(along))));
}
