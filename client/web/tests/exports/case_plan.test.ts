// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { create } from "@bufbuild/protobuf";
import { expect, test } from "vitest";
import { type CaseFile, openCase } from "../../src/case/case_file";
import { CASE_FILE, planOf, plannedRanges } from "../../src/exports/case_plan";
import { MaterialRangesSchema } from "../../src/generated/tissueform/v1/deform_service_pb";
import { BlendMap, GradientFieldSettingsSchema, RotationMode, StiffnessSchema } from "../../src/generated/tissueform/v1/session_pb";
import type { Pose } from "../../src/geometry/pose";
import { MESH_POSITIONS, TETS, smallCase, sourceOf } from "../testing/small_case";

const STIFFNESS_OFFSET = 8 * MESH_POSITIONS.length + 4 * TETS.length;

/** Two tets, each a tissue of its own, with these moduli in Pa. */
async function caseOf(stiffness: [number, number], arrays = ["tissue"]): Promise<CaseFile> {
  const file = await openCase(sourceOf(smallCase()));
  const bytes = new Uint8Array(new Float64Array(stiffness).buffer);
  const read = async (offset: number, length: number) => bytes.slice(offset - file.meshPayload.offset - STIFFNESS_OFFSET).subarray(0, length);
  file.meshSource = { totalBytes: 0, read };
  file.manifest.mesh.cellArrays = arrays;
  file.materialRanges = create(MaterialRangesSchema, { tissues: new Uint8Array([0, 1]), factors95: [1.8, 2.2], lowestPoissonRatio: 0.4, highestPoissonRatio: 0.48 });
  Object.assign(file.sessionRequest, {
    stiffness: create(StiffnessSchema, { source: { case: "cellArray", value: "tissue" } }),
    fixedVertices: [3, 4],
    poissonRatio: 0.45,
    gradientField: create(GradientFieldSettingsSchema, { rotationMode: RotationMode.ESTIMATED, blend: BlendMap.LINEAR, maxIterations: 7 }),
  });
  return file;
}

test("a case is a plan: its mesh, its regions, the poses that are shown", async () => {
  const file = await caseOf([16000, 27000]);
  const poses = new Map<string, Pose>([["mandible", { rotationVector: [0, 0, Math.PI / 2], pivotMm: [1, 2, 3], translationMm: [0, -6, 0], scale: 1 }]]);
  const plan = planOf(file, poses, "linear_elastic", await plannedRanges(file));
  expect(JSON.parse(JSON.stringify(plan))).toEqual({
    format: "tissueform-plan", version: 3, unit: "mm", coordinate_system: "LPS",
    mesh: CASE_FILE, mesh_sha256: "a".repeat(64),
    stiffness: { cell_data: "tissue" }, poisson_ratio: 0.45,
    fixed: { vertices: [3, 4] },
    handles: [{ name: "mandible", region: { vertices: [0, 1, 2] }, pose: { rotation_vector_deg: [0, 0, 90], pivot_mm: [1, 2, 3], translation_mm: [0, -6, 0], scale: 1 } }],
    model: "linear_elastic",
    gradient_field: { rotation: "estimated", guidance: "cotangent", blend: "linear", max_iterations: 7 },
    uncertainty: { youngs_modulus_factor_95: { by_cell_data: "tissue", values: { 16000: 1.8, 27000: 2.2 } }, poisson_ratio_95: [0.4, 0.48] },
  });
});

test("a mesh with more arrays than its stiffness has a digest of its own, and the plan says none", async () => {
  const file = await caseOf([16000, 27000], ["other", "tissue"]);
  expect(planOf(file, new Map(), "arap", null)).not.toHaveProperty("mesh_sha256");
});

test.each<[string, [number, number]]>([
  ["two tissues of one stiffness", [16000, 16000]],
  ["a stiffness that is no label", [16000, 27000.5]],
])("ranges are left out where the stiffness does not distinguish tissues: %s", async (_, stiffness) => {
  expect(await plannedRanges(await caseOf(stiffness))).toBeNull();
});
