// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { HeadFrame } from "../geometry/pose";
import type { Vector } from "../geometry/rotation";
import { CaseError, type Field } from "./field";

// What the extension TISSUEFORM_case says (docs/case-format.md), checked; names as there.

export const MAX_SURFACES = 64;
export const MAX_HANDLES = 32;
export const MAX_LANDMARKS = 256;

export const SURFACE_KINDS = ["skin", "bone", "segment", "teeth"] as const;
export type SurfaceKind = (typeof SURFACE_KINDS)[number];

export interface SurfaceEntry {
  name: string;
  kind: SurfaceKind;
  mesh: number;
  /** "" where it does not move with one. */
  handle: string;
  /** Buffer views. */
  follows: { vertices: number; weights: number } | null;
  regions: number | null;
}

export interface HandleEntry {
  name: string;
  label: string;
  pivotMm: Vector;
  pose: { rotationVectorDeg: Vector; pivotMm: Vector; translationMm: Vector; scale: number };
  limits: { translationMm: number; rotationDeg: number };
}

export interface LandmarkEntry {
  name: string;
  label: string;
  positionMm: Vector;
  handle: string;
  skinVertex: number | null;
}

export interface Manifest {
  title: string;
  notice: string;
  provenance: Record<string, string>;
  mesh: { name: string; vertexCount: number; tetCount: number; cellArrays: string[]; payload: number };
  sessionRequest: number;
  materialRanges: number | null;
  /** Null where all tissue sticks. `sticking`: a buffer view. */
  contact: { rows: number; sticking: number | null } | null;
  model: string;
  surfaces: SurfaceEntry[];
  skinRegions: { number: number; name: string; label: string }[];
  handles: HandleEntry[];
  landmarks: LandmarkEntry[];
  headFrame: HeadFrame;
}

const DEFAULT_LIMITS = { translationMm: 20, rotationDeg: 30 };
const VERSION = 2;
const MAX_CONTACT_ROWS = 16384;
const MAX_COUNT = 2 ** 31 - 1;

/** Throws a CaseError that names the key. `views` and `meshes`: how many the file has. */
export function readManifest(root: Field, views: number, meshes: number): Manifest {
  root.get("format").oneOf(["tissueform-case"]);
  const version = root.get("version").integer(1, MAX_COUNT);
  if (version > VERSION) throw new CaseError(`the case has version ${version}, and this planner knows ${VERSION}: open it with a newer one`);
  root.get("unit").oneOf(["mm"]);
  root.get("coordinate_system").oneOf(["LPS"]);
  const view = (field: Field) => field.integer(0, views - 1);
  const optionalView = (field: Field) => (field.isPresent ? view(field) : null);
  const handles = root.get("handles").list(MAX_HANDLES).map(readHandle);
  if (new Set(handles.map((handle) => handle.name)).size !== handles.length) root.get("handles").fail("a list of handles with a name of its own each");
  const names = ["", ...handles.map((handle) => handle.name)];
  return {
    title: root.get("title").textOr(""),
    notice: root.get("notice").textOr(""),
    provenance: readProvenance(root.get("provenance")),
    mesh: readMesh(root.get("mesh"), view),
    sessionRequest: view(root.get("session_request")),
    materialRanges: optionalView(root.get("material_ranges")),
    contact: readContact(root.get("contact"), optionalView),
    model: root.get("model").text(),
    surfaces: root.get("surfaces").list(MAX_SURFACES).map((surface) => readSurface(surface, view, meshes, names)),
    skinRegions: listOr(root.get("skin_regions"), 255).map((region) => ({
      number: region.get("number").integer(1, 255),
      name: region.get("name").text(),
      label: region.get("label").textOr(region.get("name").text()),
    })),
    handles,
    landmarks: listOr(root.get("landmarks"), MAX_LANDMARKS).map((landmark) => readLandmark(landmark, names)),
    headFrame: readHeadFrame(root.get("head_frame")),
  };
}

function listOr(field: Field, most: number): Field[] {
  return field.isPresent ? field.list(most) : [];
}

function readProvenance(field: Field): Record<string, string> {
  const keys = ["software", "commit", "created", "plan_sha256"];
  if (!field.isPresent) return {};
  return Object.fromEntries(keys.map((key) => [key, field.get(key).textOr("")]));
}

function readContact(field: Field, optionalView: (field: Field) => number | null): Manifest["contact"] {
  if (!field.isPresent) return null;
  return { rows: field.get("rows").integer(1, MAX_CONTACT_ROWS), sticking: optionalView(field.get("sticking")) };
}

function readMesh(field: Field, view: (field: Field) => number): Manifest["mesh"] {
  const name = field.get("name").text();
  if (!/^meshes\/[0-9a-f]{64}$/.test(name)) field.get("name").fail("meshes/ and a SHA-256");
  return {
    name,
    vertexCount: field.get("vertex_count").integer(1, MAX_COUNT),
    tetCount: field.get("tet_count").integer(1, MAX_COUNT),
    cellArrays: listOr(field.get("cell_arrays"), 64).map((entry) => entry.text()),
    payload: view(field.get("payload")),
  };
}

function readSurface(field: Field, view: (field: Field) => number, meshes: number, names: string[]): SurfaceEntry {
  const follows = field.get("follows");
  const handle = field.get("handle").isPresent ? field.get("handle").oneOf(names) : "";
  const kind = field.get("kind").oneOf(SURFACE_KINDS);
  if (kind === "segment" && handle === "") field.get("handle").fail("the name of a handle, as a segment needs it");
  return {
    name: field.get("name").text(),
    kind,
    mesh: field.get("mesh").integer(0, meshes - 1),
    handle,
    follows: follows.isPresent ? { vertices: view(follows.get("vertices")), weights: view(follows.get("weights")) } : null,
    regions: field.get("regions").isPresent ? view(field.get("regions")) : null,
  };
}

export function readHandle(field: Field): HandleEntry {
  const name = field.get("name").text();
  if (name === "") field.get("name").fail("a name");
  const pivotMm = field.get("pivot_mm").vector();
  const pose = field.get("pose");
  const limits = field.get("limits");
  const zero: Vector = [0, 0, 0];
  const vectorOr = (part: Field) => (part.isPresent ? part.vector() : zero);
  const positive = (part: Field, other: number) => {
    const number = part.isPresent ? part.number() : other;
    if (number <= 0) part.fail("positive");
    return number;
  };
  return {
    name,
    label: field.get("label").textOr(name),
    pivotMm,
    pose: !pose.isPresent
      ? { rotationVectorDeg: zero, pivotMm: zero, translationMm: zero, scale: 1 }
      : {
          rotationVectorDeg: vectorOr(pose.get("rotation_vector_deg")),
          pivotMm: vectorOr(pose.get("pivot_mm")),
          translationMm: vectorOr(pose.get("translation_mm")),
          scale: positive(pose.get("scale"), 1),
        },
    limits: !limits.isPresent
      ? DEFAULT_LIMITS
      : {
          translationMm: positive(limits.get("translation_mm"), DEFAULT_LIMITS.translationMm),
          rotationDeg: positive(limits.get("rotation_deg"), DEFAULT_LIMITS.rotationDeg),
        },
  };
}

function readLandmark(field: Field, names: string[]): LandmarkEntry {
  const name = field.get("name").text();
  const skinVertex = field.get("skin_vertex");
  return {
    name,
    label: field.get("label").textOr(name),
    positionMm: field.get("position_mm").vector(),
    handle: field.get("handle").isPresent ? field.get("handle").oneOf(names) : "",
    skinVertex: skinVertex.isPresent ? skinVertex.integer(0, MAX_COUNT) : null,
  };
}

export function readHeadFrame(field: Field): HeadFrame {
  const frame = {
    originMm: field.get("origin_mm").vector(),
    left: field.get("left").vector(),
    posterior: field.get("posterior").vector(),
    superior: field.get("superior").vector(),
    source: field.get("source").textOr("scanner"),
  };
  const axes = [frame.left, frame.posterior, frame.superior];
  const dot = (a: Vector, b: Vector) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const isFrame = axes.every((a, i) => axes.every((b, j) => Math.abs(dot(a, b) - (i === j ? 1 : 0)) < 1e-3));
  const [l, p, s] = axes;
  const turned = l[0] * (p[1] * s[2] - p[2] * s[1]) + l[1] * (p[2] * s[0] - p[0] * s[2]) + l[2] * (p[0] * s[1] - p[1] * s[0]);
  if (!isFrame || turned < 0) field.fail("three unit vectors at right angles, left, posterior and superior");
  return frame;
}
