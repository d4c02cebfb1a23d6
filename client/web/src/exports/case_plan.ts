// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { CaseFile } from "../case/case_file";
import { withSticking } from "../case/sticking";
import { BlendMap, type ContactRow, type GradientFieldSettings, Guidance, type LipEdge, RotationMode } from "../generated/tissueform/v1/session_pb";
import type { Pose } from "../geometry/pose";

// A case as a plan (docs/plan-format.md). The case itself is the plan's mesh, and regions are numbers of its vertices.

/** The name under which the page saves a case, and by which exported plans name it. */
export const CASE_FILE = "tissueform-case.tfcase";

/** As a plan says it; null: not known, or not to be said in a plan. */
export type PlannedRanges = { youngs_modulus_factor_95: object; poisson_ratio_95?: number[] } | null;

/** What `tissueform deform` needs. `poses` by handle; `model`: by its name in plans. */
export function planOf(shown: CaseFile, poses: ReadonlyMap<string, Pose>, model: string, ranges: PlannedRanges): object {
  // Without contact, too, the plan is of the mesh in the case file: `--contact off` joins its lips.
  const file = shown.parted ?? shown;
  const { manifest, sessionRequest: request, sticking } = file;
  const hasContact = request.contact.length > 0;
  const source = request.stiffness?.source;
  const stiffnessArrays = source?.case === "cellArray" ? [source.value] : [];
  // Programs compute the digest of positions, tets and the stiffness; of a case with other arrays it is another one.
  const hasDigest = manifest.mesh.cellArrays.join("\n") === stiffnessArrays.join("\n");
  return {
    format: "tissueform-plan",
    version: hasContact ? 4 : 3,
    unit: "mm",
    coordinate_system: "LPS",
    mesh: CASE_FILE,
    ...(hasDigest ? { mesh_sha256: manifest.mesh.name.replace("meshes/", "") } : {}),
    stiffness: source?.case === "uniformPa" ? { uniform: source.value } : { cell_data: source?.value },
    poisson_ratio: request.poissonRatio,
    fixed: { vertices: withSticking(request.fixedVertices, sticking, -1) },
    handles: request.handles.map(({ name, vertices }, index) => ({ name, region: { vertices: withSticking(vertices, sticking, index) }, pose: poseJson(poses.get(name)) })),
    ...(hasContact ? { contact: { rows: request.contact.map(rowJson), ...sealJson(request.lipEdge) } } : {}),
    model,
    gradient_field: gradientFieldJson(request.gradientField),
    ...(ranges === null ? {} : { uncertainty: ranges }),
  };
}

function sealJson(edge: LipEdge | undefined): object {
  return edge === undefined ? {} : { seal: { up: [edge.up?.x ?? 0, edge.up?.y ?? 0, edge.up?.z ?? 0], pairs: edge.pairs.map(({ upper, lower }) => [upper, lower]) } };
}

function rowJson({ vertex, other, normal, gapMm, bilateral }: ContactRow): object {
  const keys = { handle: "handle", fixedBone: "fixed", otherVertex: "other_vertex" };
  return {
    vertex,
    ...(other.case === undefined ? {} : { [keys[other.case]]: other.value }),
    normal: [normal?.x ?? 0, normal?.y ?? 0, normal?.z ?? 0],
    ...(gapMm === 0 ? {} : { gap_mm: gapMm }),
    ...(bilateral ? { bilateral } : {}),
  };
}

export function poseJson(pose: Pose | undefined): object | undefined {
  if (pose === undefined) return undefined;
  const { rotationVector, pivotMm, translationMm, scale } = pose;
  return { rotation_vector_deg: rotationVector.map((part) => (part * 180) / Math.PI), pivot_mm: pivotMm, translation_mm: translationMm, scale };
}

function gradientFieldJson(settings: GradientFieldSettings | undefined): object | undefined {
  if (settings === undefined) return undefined;
  const rotations: Partial<Record<RotationMode, string>> = { [RotationMode.NONE]: "none", [RotationMode.ESTIMATED]: "estimated" };
  return {
    rotation: rotations[settings.rotationMode] ?? "propagated",
    guidance: settings.guidance === Guidance.UNIFORM ? "uniform" : "cotangent",
    blend: settings.blend === BlendMap.LINEAR ? "linear" : "cosine",
    max_iterations: settings.maxIterations,
    tolerance_mm: settings.toleranceMm,
  };
}

/**
 * A case has a number for the tissue of each tet, a plan needs an array of the mesh that distinguishes them: the stiffness does so
 * where each tissue has one whole number of Pa of its own. Null where it does not. Rejects as the case's source does.
 */
export async function plannedRanges(file: CaseFile): Promise<PlannedRanges> {
  const { materialRanges: ranges, sessionRequest: request } = file;
  const source = request.stiffness?.source;
  if (ranges === null || source?.case !== "cellArray") return null;
  const factors = factorsByStiffness(ranges.tissues, ranges.factors95, await readCellArray(file, source.value));
  const { lowestPoissonRatio: lowest, highestPoissonRatio: highest } = ranges;
  if (factors === null) return null;
  return {
    youngs_modulus_factor_95: { by_cell_data: source.value, values: factors },
    ...(lowest === undefined || highest === undefined ? {} : { poisson_ratio_95: [lowest, highest] }),
  };
}

async function readCellArray({ manifest, meshPayload, meshSource }: CaseFile, name: string): Promise<Float64Array> {
  const { vertexCount, tetCount, cellArrays } = manifest.mesh;
  const index = cellArrays.indexOf(name);
  if (index < 0) return new Float64Array();
  const bytes = await meshSource.read(meshPayload.offset + 24 * vertexCount + 16 * tetCount + 8 * tetCount * index, 8 * tetCount);
  return new Float64Array(bytes.buffer, bytes.byteOffset, tetCount);
}

function factorsByStiffness(tissues: Uint8Array, factors: readonly number[], stiffness: Float64Array): Record<string, number> | null {
  const stiffnessOf = new Map<number, number>();
  tissues.forEach((tissue, tet) => stiffnessOf.has(tissue) || stiffnessOf.set(tissue, stiffness[tet]));
  const isOneToOne = new Set(stiffnessOf.values()).size === stiffnessOf.size && tissues.every((tissue, tet) => stiffnessOf.get(tissue) === stiffness[tet]);
  if (!isOneToOne || !Array.from(stiffnessOf.values()).every(Number.isSafeInteger)) return null;
  return Object.fromEntries(Array.from(stiffnessOf, ([tissue, pa]) => [String(pa), factors[tissue]]));
}
