// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Vector } from "../geometry/rotation";
import type { CaseFile } from "./case_file";

/** The corners of a tet's faces, and the corner across. */
const FACES = [[0, 1, 2, 3], [0, 1, 3, 2], [0, 2, 3, 1], [1, 2, 3, 0]] as const;

/** A triangle of the mesh's boundary. */
interface Face {
  corners: number[];
  across: number;
}

/**
 * The area in mm2 on which each contact row that may lift off presses, in the order of the session request: a third of every boundary
 * triangle at its vertex that faces bone or the other lip, projected along the row's normal. The areas of the rows of a flat surface add
 * up to the surface. 0: nothing there faces the row.
 */
export async function contactAreas({ manifest, sessionRequest, meshPayload, meshSource }: CaseFile): Promise<Float64Array> {
  const { vertexCount, tetCount } = manifest.mesh;
  const payload = await meshSource.read(meshPayload.offset, 24 * vertexCount + 16 * tetCount);
  const positions = new Float64Array(payload.slice(0, 24 * vertexCount).buffer);
  const rows = sessionRequest.contact.filter(({ bilateral }) => !bilateral);
  const faces = boundaryAt(new Set(rows.map(({ vertex }) => vertex)), new Int32Array(payload.slice(24 * vertexCount).buffer));
  return Float64Array.from(rows, ({ vertex, normal }) => {
    const along: Vector = [normal?.x ?? 0, normal?.y ?? 0, normal?.z ?? 0];
    return (faces.get(vertex) ?? []).reduce((sum, face) => sum + facingArea(face, positions, along) / 3, 0);
  });
}

/** The boundary triangles at each of some vertices. All tets at a triangle of such a vertex are tets of that vertex. */
function boundaryAt(vertices: ReadonlySet<number>, tets: Int32Array): Map<number, Face[]> {
  const once = new Map<string, Face | null>();
  for (let tet = 0; tet < tets.length; tet += 4) {
    if (![0, 1, 2, 3].some((corner) => vertices.has(tets[tet + corner]))) continue;
    for (const [a, b, c, across] of FACES) {
      const corners = [tets[tet + a], tets[tet + b], tets[tet + c]];
      const key = corners.slice().sort((left, right) => left - right).join();
      once.set(key, once.has(key) ? null : { corners, across: tets[tet + across] });
    }
  }
  const faces = new Map<number, Face[]>();
  for (const face of once.values()) {
    for (const corner of face?.corners ?? []) {
      if (face !== null && vertices.has(corner)) faces.set(corner, [...(faces.get(corner) ?? []), face]);
    }
  }
  return faces;
}

/** Of a triangle's area what is seen against `along`, 0 from behind. */
function facingArea({ corners, across }: Face, positions: Float64Array, along: Vector): number {
  const from = (vertex: number) => [0, 1, 2].map((axis) => positions[3 * vertex + axis] - positions[3 * corners[0] + axis]);
  const [u, v, inwards] = [from(corners[1]), from(corners[2]), from(across)];
  const twiceArea = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
  const dot = (left: readonly number[], right: readonly number[]) => left.reduce((sum, value, axis) => sum + value * right[axis], 0);
  return Math.max(0, (Math.sign(dot(twiceArea, inwards)) * dot(twiceArea, along)) / 2);
}
