// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import * as three from "three";
import { headAxes, toMove } from "../geometry/pose";
import { measureFace } from "../measures/face_measures";
import { landmarkMovement } from "../planning/landmarks";
import type { DrawnSurface } from "../scene/head";
import type { Workbench } from "../workbench/workbench";
import { type ExportedSurface, NOTICE } from "./files";

/** What is shown, as files have it: bone where it was moved to. `what`: the skin, or all. */
export function exportedSurfaces(bench: Workbench, what: "skin" | "all"): ExportedSurface[] {
  const surfaces = what === "skin" ? bench.view.head.skins : bench.view.head.surfaces;
  return surfaces.map(exportSurface);
}

function exportSurface({ source, shape, mesh }: DrawnSurface): ExportedSurface {
  const positions = new Float32Array(shape.positions);
  const point = new three.Vector3();
  for (let i = 0; i < positions.length; i += 3) point.fromArray(positions, i).applyMatrix4(mesh.matrix).toArray(positions, i);
  return { name: source.entry.name, positions, triangles: source.triangles };
}

/** How it came about, for every file. */
export function provenanceLines(bench: Workbench): string[] {
  const { provenance, mesh } = bench.file.manifest;
  return [
    `case ${bench.caseName}`,
    `mesh ${mesh.name}`,
    `model ${bench.modelInfo(bench.model.value)?.name ?? ""}`,
    ...Object.entries(provenance).map(([key, value]) => `${key} ${value}`),
  ];
}

/** Plan, movements and provenance as JSON. */
export function planDocument(bench: Workbench): string {
  const { manifest } = bench.file;
  const poses = bench.plan.poses();
  const summary = bench.picture.value?.summary;
  const skin = bench.file.surfaces.findIndex(({ entry }) => entry.kind === "skin");
  const band = skin < 0 ? null : bench.bandOf(skin);
  const document = {
    format: "tissueform-planner-export",
    version: 1,
    notice: NOTICE,
    exported: new Date().toISOString(),
    case: bench.caseName,
    title: manifest.title,
    provenance: manifest.provenance,
    mesh: manifest.mesh.name,
    model: bench.modelInfo(bench.model.value)?.name ?? null,
    unit: "mm",
    coordinate_system: "LPS",
    head_frame: { ...manifest.headFrame, axes: headAxes(manifest.headFrame) },
    segments: bench.plan.handles.map((handle, index) => ({
      handle: handle.name,
      move: bench.plan.moves[index],
      move_about_plan_pivot: toMove(poses[index], handle.pivotMm, manifest.headFrame),
      pose: {
        rotation_vector_deg: poses[index].rotationVector.map((part) => (part * 180) / Math.PI),
        pivot_mm: poses[index].pivotMm,
        translation_mm: poses[index].translationMm,
        scale: poses[index].scale,
      },
    })),
    landmarks: manifest.landmarks.map((landmark) => ({
      name: landmark.name,
      ...landmarkMovement(landmark, bench.shownPoses, bench.skinPoint, manifest.headFrame),
      ...(landmark.skinVertex === null || band === null ? {} : { band_95_mm: band[landmark.skinVertex] }),
    })),
    measurement_landmarks: bench.landmarks.save(),
    measures: measureFace(bench).flatMap((result) => {
      if (result.kind !== "value") return [];
      const { definition, before, after, band } = result;
      return [{ name: definition.name, title: definition.title, unit: definition.unit, before, after, ...(band === null ? {} : { lowest_after: band.lowest, highest_after: band.highest }) }];
    }),
    answer: summary == null ? null : { prepared: summary.prepared, converged: summary.converged, error_bound_mm: summary.errorBoundMm, error_estimate_mm: summary.errorEstimateMm },
    predictions: bench.stored.all.value.map(({ name, title }) => ({ name, title })),
  };
  return JSON.stringify(document, null, 2);
}
