// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import * as three from "three";
import { sealedPairs } from "../case/contact_choice";
import { headAxes, toMove } from "../geometry/pose";
import type { MeasureResult } from "../measures/evaluation";
import type { MovementBand } from "../measures/movement_bands";
import { intervalOf } from "../measures/texts";
import { type ShownFace, landmarkMovements } from "../measures/face_measures";
import type { DrawnSurface } from "../scene/head";
import { type ShownAnswer, modelShown } from "../workbench/shown_answer";
import type { StoredPredictions } from "../workbench/stored_predictions";
import type { Workbench } from "../workbench/workbench";
import { type PlannedRanges, planOf } from "./case_plan";
import { type ExportedSurface, NOTICE } from "./files";

/** What is shown, as files have it: bone where it was moved to. `what`: the skin, or all. */
export function exportedSurfaces(bench: Workbench, what: "skin" | "all"): ExportedSurface[] {
  const { head } = bench.view;
  const surfaces = what === "skin" ? head.skins : head.surfaces;
  return surfaces.map((surface) => exportSurface(surface, what === "skin" ? bench.bandOf(head.surfaces.indexOf(surface)) : null));
}

function exportSurface({ source, shape, mesh }: DrawnSurface, bandMm: Float32Array | null): ExportedSurface {
  const positions = new Float32Array(shape.positions);
  const point = new three.Vector3();
  for (let i = 0; i < positions.length; i += 3) point.fromArray(positions, i).applyMatrix4(mesh.matrix).toArray(positions, i);
  return { name: source.entry.name, positions, triangles: source.triangles, bandMm };
}

/** The face that is shown is another one than that of the plan's numbers. */
export const NOT_THE_PLAN = "the face that is shown is not the plan's: a comparison, or an open jaw";

/** How what is shown came about, for every file. */
export function provenanceLines(bench: Workbench): string[] {
  const { provenance, mesh } = bench.file.manifest;
  return [
    `case ${bench.caseName}`,
    `mesh ${mesh.name}`,
    `model ${bench.modelInfo(modelShown(bench.comparison.value, bench.model.value))?.name ?? ""}`,
    ...contactLine(bench),
    ...(bench.showsPlan ? [] : [NOT_THE_PLAN]),
    ...Object.entries(provenance).map(([key, value]) => `${key} ${value}`),
  ];
}

/** Nothing for a case that has no contact. */
function contactLine({ file }: Pick<Workbench, "file">): string[] {
  if (file.parted !== null) return ["contact off: tissue sticks, lips are one piece"];
  if (sealedPairs(file) > 0) return ["contact: lips part, tissue slides; closed lips stay closed (seal: posture, not mechanics)"];
  return file.sessionRequest.contact.length > 0 ? ["contact: lips part, tissue slides"] : [];
}

/** What measureAtRest and movementBandsAtRest give. */
export interface NumbersAtRest {
  measures: readonly MeasureResult[];
  movements: readonly (MovementBand | null)[] | null;
}

/** What the export contains of a plan. */
export type ExportedPlan = ShownFace & Pick<Workbench, "answer" | "caseName" | "model" | "modelInfo" | "plan"> & { stored: Pick<StoredPredictions, "all"> };

/**
 * A plan that `tissueform plan check` and `deform` take (docs/plan-format.md), with what the planner shows of it. Movements and
 * measures are of the plan's face, and left out while another one is shown. `ranges`: what plannedRanges gives.
 */
export function planDocument(bench: ExportedPlan, atRest: NumbersAtRest, ranges: PlannedRanges = null): string {
  const { manifest, materialRanges } = bench.file;
  const poses = bench.plan.poses();
  const byHandle = new Map(bench.plan.handles.map(({ name }, index) => [name, poses[index]]));
  const leftOut = [
    ...(bench.showsPlan ? [] : [`landmarks, measures and answer: ${NOT_THE_PLAN}`]),
    ...(bench.file.parted !== null ? ["contact: the face and its measures are without it; tissueform deform --contact off gives them"] : []),
    ...(sealedPairs(bench.file) > 0 ? ["contact: the face and its measures are with sealed lips; tissueform deform --seal gives them"] : []),
    ...(materialRanges !== null && ranges === null ? ["uncertainty: the stiffness does not distinguish the tissues of the case"] : []),
  ];
  const document = {
    ...planOf(bench.file, byHandle, bench.modelInfo(bench.model.value)?.name ?? manifest.model, ranges),
    notice: NOTICE,
    exported: new Date().toISOString(),
    case: bench.caseName,
    title: manifest.title,
    provenance: manifest.provenance,
    head_frame: { ...manifest.headFrame, axes: headAxes(manifest.headFrame) },
    segments: bench.plan.handles.map((handle, index) => ({
      handle: handle.name,
      move: bench.plan.moves[index],
      move_about_plan_pivot: toMove(poses[index], handle.pivotMm, manifest.headFrame),
    })),
    measurement_landmarks: bench.landmarks.save(),
    ...(bench.showsPlan ? { landmarks: movements(bench, atRest.movements), measures: measures(atRest.measures), answer: answerFacts(bench.answer.value) } : {}),
    ...(leftOut.length === 0 ? {} : { left_out: leftOut.join("; ") }),
    predictions: bench.stored.all.value.map(({ name, title }) => ({ name, title })),
  };
  // Thousands of vertices in a line, not in as many lines. No text of JSON has a line break in it.
  return JSON.stringify(document, null, 2).replace(/\[\n[\s\d.,eE+-]+\]/g, (numbers) => numbers.replace(/\s+/g, ""));
}

function movements(bench: ExportedPlan, bands: NumbersAtRest["movements"]): object[] {
  const { landmarks } = bench.file.manifest;
  return landmarkMovements(bench).map(({ bandMm, ...movement }, index) => {
    const total = bands?.[index]?.totalMm;
    return {
      name: landmarks[index].name,
      ...movement,
      ...(bandMm === null ? {} : { band_95_mm: bandMm }),
      ...(total === undefined ? {} : { lowest_total_mm: total.lowest, highest_total_mm: total.highest, interval_of: intervalOf(total), deviations: total.parts?.source }),
    };
  });
}

function measures(results: readonly MeasureResult[]): object[] {
  return results.flatMap((result) => {
    if (result.kind !== "value") return [];
    const { definition, before, after, band } = result;
    const interval = band === null ? {} : { lowest_after: band.lowest, highest_after: band.highest, interval_of: intervalOf(band), deviations: band.parts?.source };
    return [{ name: definition.name, title: definition.title, unit: definition.unit, before, after, ...interval }];
  });
}

/** An estimate has no bound: whichever does not hold is null. */
function answerFacts(answer: ShownAnswer | null): object | null {
  if (answer === null) return null;
  if (answer.by === "page") {
    const { errorBoundMm, isEstimate } = answer;
    return { given_by: "page", prepared: true, refining: false, converged: null, error_bound_mm: isEstimate ? null : errorBoundMm, error_estimate_mm: isEstimate ? errorBoundMm : null };
  }
  const { summary, isRefining } = answer;
  const isEstimate = isRefining || summary.errorEstimateMm > 0;
  return {
    given_by: "server",
    prepared: summary.prepared,
    refining: isRefining,
    converged: summary.converged,
    load: summary.load,
    error_bound_mm: summary.prepared && !isEstimate ? summary.errorBoundMm : null,
    error_estimate_mm: summary.prepared && isEstimate ? summary.errorEstimateMm : null,
  };
}
