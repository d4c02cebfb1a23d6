// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { createHash } from "node:crypto";
import { type MessageInitShape, create, toBinary } from "@bufbuild/protobuf";
import type { ContactRowSchema, LipEdgeSchema } from "../../src/generated/tissueform/v1/session_pb";
import { CreateSessionRequestSchema } from "../../src/generated/tissueform/v1/session_service_pb";
import { HAND_MADE_FACE } from "./hand_made_face";
import { concat, container, layOut } from "./small_case";

// The hand-made face as a case that a server opens: its profile drawn out to a strip of skin, before a block of tissue in which a
// lower jaw moves, with teeth of one triangle at each of their landmarks. The head frame is LPS.

type Point = [number, number, number];
interface Surface {
  positions: Float32Array;
  triangles: Uint32Array;
}

/** Left, forward, up to LPS. */
function lps(name: string): Point {
  const point = HAND_MADE_FACE.get(name);
  if (point === undefined) throw new Error(`the hand-made face has no ${name}`);
  return [point.left, point.forward === 0 ? 0 : -point.forward, point.up];
}

const PROFILE = ["soft_glabella", "pronasale", "columella", "subnasale", "labrale_superius", "stomion_superius", "stomion_inferius", "labrale_inferius", "sublabiale", "soft_pogonion", "soft_menton"];
const UPPER = ["upper_incisor", "upper_midline", "upper_molar_left", "upper_molar_right"];
const LOWER = ["lower_incisor", "lower_midline"];
const HALF_WIDTH_MM = 15;

/** Three vertices a landmark: right, in the middle, left. */
function skin(): Surface {
  const positions = PROFILE.flatMap((name) => [-HALF_WIDTH_MM, 0, HALF_WIDTH_MM].flatMap((x) => [x, lps(name)[1], lps(name)[2]]));
  const triangles = PROFILE.slice(1).flatMap((_, row) =>
    [0, 1].flatMap((column) => {
      const a = 3 * row + column;
      return [a, a + 3, a + 1, a + 1, a + 3, a + 4];
    }),
  );
  return { positions: Float32Array.from(positions), triangles: Uint32Array.from(triangles) };
}

function teeth(names: readonly string[]): Surface {
  const positions = names.flatMap((name) => {
    const [x, y, z] = lps(name);
    return [x, y, z, x, y + 0.1, z, x, y, z + 0.1];
  });
  return { positions: Float32Array.from(positions), triangles: Uint32Array.from({ length: positions.length / 3 }, (_, i) => i) };
}

const COUNTS = [6, 8, 14] as const;
const LOW: Point = [-24, -24, -66];
const STEP_MM = 8;

interface Block {
  positions: Float64Array;
  tets: Int32Array;
}

/** Cubes of 8 mm, each in six tets along its diagonal. */
function block(): Block {
  const [nx, ny, nz] = COUNTS;
  const index = (i: number, j: number, k: number) => i + (nx + 1) * (j + (ny + 1) * k);
  const positions: number[] = [];
  const tets: number[] = [];
  const orders = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];
  for (let k = 0; k <= nz; ++k) {
    for (let j = 0; j <= ny; ++j) {
      for (let i = 0; i <= nx; ++i) {
        positions.push(LOW[0] + STEP_MM * i, LOW[1] + STEP_MM * j, LOW[2] + STEP_MM * k);
        if (i === nx || j === ny || k === nz) continue;
        orders.forEach((order, number) => {
          const at = [i, j, k];
          const path = order.map((axis) => {
            at[axis] += 1;
            return index(at[0], at[1], at[2]);
          });
          const [a, b, c] = path;
          tets.push(...(number < 3 ? [index(i, j, k), a, b, c] : [index(i, j, k), b, a, c]));
        });
      }
    }
  }
  return { positions: Float64Array.from(positions), tets: Int32Array.from(tets) };
}

function verticesWhere({ positions }: Block, wanted: (point: Point) => boolean): number[] {
  return Array.from({ length: positions.length / 3 }, (_, v) => v).filter((v) => wanted([positions[3 * v], positions[3 * v + 1], positions[3 * v + 2]]));
}

/** The nearest vertex of the block's front for each of the skin. */
function follows({ positions }: Surface, mesh: Block): Int32Array {
  const front = verticesWhere(mesh, ([, y]) => y === LOW[1]);
  return Int32Array.from({ length: positions.length }, (_, i) => {
    if (i % 3 !== 0) return front[0];
    const distance = (v: number) => Math.hypot(mesh.positions[3 * v] - positions[i], mesh.positions[3 * v + 2] - positions[i + 2]);
    return front.reduce((best, v) => (distance(v) < distance(best) ? v : best));
  });
}

function meshName({ positions, tets }: Block, payload: Uint8Array): string {
  const text = `tissueform-mesh 1\nvertices ${positions.length / 3}\ntets ${tets.length / 4}\n`;
  return `meshes/${createHash("sha256").update(text).update(payload).digest("hex")}`;
}

/** What parts the lips: a seam through the block's front in the height of a lattice plane, and bone along which tissue slides. */
interface Parting {
  mesh: Block;
  rows: MessageInitShape<typeof ContactRowSchema>[];
  /** Of the seam on the skin, between the corners. */
  lipEdge: MessageInitShape<typeof LipEdgeSchema>;
  /** Pairs of a vertex and its handle. */
  sticking: Int32Array;
}

const SEAM_UP = -26;
/** Above it the tissue slides on the lower jaw. */
const VESTIBULE_UP = -40;

/** Doubles of the seam come last, and are the lower lip's. */
function parted(whole: Block, jaw: readonly number[]): Parting {
  const seam = verticesWhere(whole, ([x, y, z]) => z === SEAM_UP && y <= LOW[1] + 3 * STEP_MM && Math.abs(x) <= 2 * STEP_MM);
  const count = whole.positions.length / 3;
  const doubleOf = new Map(seam.map((vertex, i) => [vertex, count + i]));
  const isBelow = (t: number) => [0, 1, 2, 3].every((corner) => whole.positions[3 * whole.tets[4 * t + corner] + 2] <= SEAM_UP);
  const tets = whole.tets.map((vertex, i) => (isBelow(Math.floor(i / 4)) ? (doubleOf.get(vertex) ?? vertex) : vertex));
  const positions = Float64Array.from([...whole.positions, ...seam.flatMap((vertex) => Array.from(whole.positions.subarray(3 * vertex, 3 * vertex + 3)))]);
  const front = Math.min(...jaw.map((vertex) => whole.positions[3 * vertex + 1]));
  const sliding = jaw.filter((vertex) => whole.positions[3 * vertex + 1] === front && whole.positions[3 * vertex + 2] > VESTIBULE_UP);
  return {
    mesh: { positions, tets },
    rows: [
      ...seam.map((vertex, i) => ({ vertex: count + i, other: { case: "otherVertex" as const, value: vertex }, normal: { x: 0, y: 0, z: -1 } })),
      ...sliding.map((vertex) => ({ vertex, other: { case: "handle" as const, value: "mandible" }, normal: { x: 0, y: -1, z: 0 }, bilateral: true })),
    ],
    lipEdge: { up: { x: 0, y: 0, z: 1 }, pairs: seam.flatMap((vertex, i) => (whole.positions[3 * vertex + 1] === LOW[1] ? [{ upper: vertex, lower: count + i }] : [])) },
    sticking: Int32Array.from(sliding.flatMap((vertex) => [vertex, 0])),
  };
}

/** The bytes of the .tfcase. `hasContact`: its lips part; without contact it is the same as the one that has none. */
export function handMadeCase(hasContact = false): Uint8Array<ArrayBuffer> {
  const whole = block();
  const jaw = verticesWhere(whole, ([x, y, z]) => Math.abs(x) < 17 && y > -10 && y < 20 && z < -30 && z > -60);
  const parting = hasContact ? parted(whole, jaw) : null;
  const mesh = parting?.mesh ?? whole;
  const stuck = new Set(parting?.sticking.filter((_, i) => i % 2 === 0));
  const payload = concat([mesh.positions, mesh.tets]);
  const name = meshName(mesh, payload);
  const request = create(CreateSessionRequestSchema, {
    mesh: name,
    stiffness: { source: { case: "uniformPa", value: 15_000 } },
    fixedVertices: verticesWhere(mesh, ([, y]) => y === LOW[1] + STEP_MM * COUNTS[1]),
    handles: [{ name: "mandible", vertices: jaw.filter((vertex) => !stuck.has(vertex)) }],
    contact: parting?.rows,
    lipEdge: parting?.lipEdge,
    model: hasContact ? 3 : 1,
  });
  const face = skin();
  const surfaces = [face, teeth(UPPER), teeth(LOWER)];
  const weights = Float32Array.from({ length: face.positions.length }, (_, i) => (i % 3 === 0 ? 1 : 0));
  const chunks = [...surfaces.flatMap(({ positions, triangles }) => [positions, triangles]), follows(face, mesh), weights, toBinary(CreateSessionRequestSchema, request), ...(parting === null ? [] : [parting.sticking]), payload];
  const { views, bin } = layOut(chunks);
  return container(JSON.stringify(gltf(surfaces, views, bin.length, manifest(mesh, name, request.contact.length))), bin);
}

function gltf(surfaces: readonly Surface[], views: unknown[], binBytes: number, extension: unknown): unknown {
  return {
    asset: { version: "2.0" },
    buffers: [{ byteLength: binBytes }],
    bufferViews: views,
    accessors: surfaces.flatMap(({ positions, triangles }, index) => [
      { bufferView: 2 * index, componentType: 5126, count: positions.length / 3, type: "VEC3", min: [-100, -100, -100], max: [100, 100, 100] },
      { bufferView: 2 * index + 1, componentType: 5125, count: triangles.length, type: "SCALAR" },
    ]),
    meshes: surfaces.map((_, index) => ({ primitives: [{ attributes: { POSITION: 2 * index }, indices: 2 * index + 1, mode: 4 }] })),
    extensionsUsed: ["TISSUEFORM_case"],
    extensions: { TISSUEFORM_case: extension },
  };
}

/** Values that the page assumes if they are missing, and that C++ requires. */
const COMPLETE = {
  pose: { rotation_vector_deg: [0, 0, 0], pivot_mm: [0, 0, 0], translation_mm: [0, 0, 0], scale: 1 },
  limits: { translation_mm: 20, rotation_deg: 30 },
};

function manifest(mesh: Block, name: string, rows: number): unknown {
  const skinLandmarks = PROFILE.map((landmark, row) => ({ name: landmark, label: landmark, position_mm: lps(landmark), skin_vertex: 3 * row + 1 }));
  const bone = (landmark: string, handle?: string) => ({ name: landmark, label: landmark, position_mm: lps(landmark), ...(handle === undefined ? {} : { handle }) });
  const condyle = (landmark: string, x: number) => ({ name: landmark, label: landmark, position_mm: [x, 40, 10] });
  return {
    format: "tissueform-case",
    version: rows > 0 ? 2 : 1,
    title: "Hand-made face",
    notice: "not a medical device",
    provenance: { software: "test", commit: "none", created: "2026-01-01T00:00:00Z", plan_sha256: "0".repeat(64) },
    unit: "mm",
    coordinate_system: "LPS",
    mesh: { name, vertex_count: mesh.positions.length / 3, tet_count: mesh.tets.length / 4, cell_arrays: [], payload: rows > 0 ? 10 : 9 },
    session_request: 8,
    ...(rows > 0 ? { contact: { rows, sticking: 9 } } : {}),
    model: rows > 0 ? "linear_elastic" : "gradient_field",
    surfaces: [
      { name: "skin", kind: "skin", mesh: 0, follows: { vertices: 6, weights: 7 } },
      { name: "upper teeth", kind: "teeth", mesh: 1 },
      { name: "lower teeth", kind: "teeth", mesh: 2, handle: "mandible" },
    ],
    skin_regions: [],
    handles: [{ name: "mandible", label: "Lower jaw", pivot_mm: [0, 40, 10], ...(rows > 0 ? COMPLETE : {}) }],
    landmarks: [...skinLandmarks, ...UPPER.map((landmark) => bone(landmark)), ...LOWER.map((landmark) => bone(landmark, "mandible")), condyle("condyle_left", 45), condyle("condyle_right", -45)],
    head_frame: { origin_mm: [0, 0, 0], left: [1, 0, 0], posterior: [0, 1, 0], superior: [0, 0, 1], source: "landmarks" },
  };
}
