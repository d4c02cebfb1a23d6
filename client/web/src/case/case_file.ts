// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { fromBinary } from "@bufbuild/protobuf";
import { type CreateSessionRequest, CreateSessionRequestSchema } from "../generated/tissueform/v1/session_service_pb";
import { type MaterialRanges, MaterialRangesSchema } from "../generated/tissueform/v1/deform_service_pb";
import { type Container, PREFIX_BYTES, type Range, jsonRange, readContainer } from "./container";
import type { Following } from "../geometry/following_surface";
import { spreadTriple } from "../geometry/rigid_fit";
import { CaseError } from "./field";
import { type Manifest, type SurfaceEntry, readManifest } from "./manifest";

/** Where the bytes of a case come from: a file of this computer, or a server. */
export interface CaseSource {
  readonly totalBytes: number;
  /** Exactly `length` bytes from `offset`. `onBytes` receives how many of them have come. */
  read(offset: number, length: number, onBytes?: (count: number) => void): Promise<Uint8Array<ArrayBuffer>>;
}

/** A surface at rest, in mm, LPS. */
export interface CaseSurface {
  entry: SurfaceEntry;
  /** #V by 3. */
  positions: Float32Array<ArrayBuffer>;
  /** #T by 3, counter-clockwise seen from outside, each below #V. */
  triangles: Uint32Array<ArrayBuffer>;
  follows: Following | null;
  /** A number of Manifest.skinRegions for each vertex, 0 for none. */
  regions: Uint8Array | null;
}

/** A case as it was opened. Everything in it was checked; what the mesh's payload holds beside positions was not read. */
export interface CaseFile {
  manifest: Manifest;
  surfaces: CaseSurface[];
  sessionRequest: CreateSessionRequest;
  materialRanges: MaterialRanges | null;
  /** Vertices of the tet mesh that surfaces follow, the probes, and where tissue may lift off, rising: what a drag asks for. */
  followed: Int32Array;
  /** For each handle three of its vertices by which others see where it is, or null where no three show that. */
  probes: ([number, number, number] | null)[];
  /** Of all vertices of the tet mesh, #V by 3, at rest, rounded to float32 as frames are. */
  restPositions: Float32Array;
  /** Where the bytes for UploadMesh lie in `meshSource`. */
  meshPayload: Range;
  meshSource: CaseSource;
  source: CaseSource;
  /** Without contact these vertices stick, in pairs: a vertex, rising, and what it sticks to (-1: fixed, else an index of the request's handles). */
  sticking: Int32Array;
  /** Of stickingCase the case whose lips were joined; else null. */
  parted: CaseFile | null;
}

/** How many of the bytes that are read have come. */
export type OpeningProgress = (doneBytes: number, totalBytes: number) => void;

/** Throws a CaseError that says what is wrong with the file; what `source.read` throws passes through. */
export async function openCase(source: CaseSource, onProgress: OpeningProgress = () => {}): Promise<CaseFile> {
  const prefix = await source.read(0, Math.min(PREFIX_BYTES, source.totalBytes));
  const json = jsonRange(prefix, source.totalBytes);
  const text = await source.read(json.offset, json.length + 8);
  const container = readContainer(text.subarray(0, json.length), text.subarray(json.length), source.totalBytes);
  const manifest = readManifest(container.manifest, container.views.length, container.meshes.length);
  const payload = container.views[manifest.mesh.payload];
  checkPayload(manifest, payload);

  const bin = json.offset + json.length + 8;
  const end = payload.offset + 24 * manifest.mesh.vertexCount;
  onProgress(0, end - bin);
  const bytes = await source.read(bin, end - bin, (count) => onProgress(count, end - bin));
  return build(source, manifest, container, new Views(container.views, bytes, bin), payload);
}

/** The part of the file that was read, by its ranges. */
class Views {
  constructor(
    private readonly views: Range[],
    private readonly bytes: Uint8Array<ArrayBuffer>,
    private readonly offset: number,
  ) {}

  /** A copy, so that numbers are aligned wherever the file has them. */
  range(range: Range): ArrayBuffer {
    const begin = range.offset - this.offset;
    if (begin < 0 || begin + range.length > this.bytes.length) {
      throw new CaseError("the case's mesh is not at the end of the file: make the file again with tissueform case pack");
    }
    return this.bytes.buffer.slice(this.bytes.byteOffset + begin, this.bytes.byteOffset + begin + range.length);
  }

  view(index: number): ArrayBuffer {
    return this.range(this.views[index]);
  }
}

function checkPayload(manifest: Manifest, payload: Range): void {
  const { vertexCount, tetCount, cellArrays } = manifest.mesh;
  const expected = 24 * vertexCount + 16 * tetCount + 8 * tetCount * cellArrays.length;
  if (payload.length !== expected) {
    throw new CaseError(`the case's mesh has ${payload.length} bytes, and its counts say ${expected}: make the file again with tissueform case pack`);
  }
}

function build(source: CaseSource, manifest: Manifest, container: Container, views: Views, payload: Range): CaseFile {
  const raw = manifest.surfaces.map((entry) => readSurface(entry, manifest, container, views));
  const rest = new Float64Array(views.range({ offset: payload.offset, length: 24 * manifest.mesh.vertexCount }));
  if (!rest.every(Number.isFinite)) throw new CaseError("the case's mesh has a position that is not a number");
  const restPositions = Float32Array.from(rest);
  const sessionRequest = parseMessage(() => readRequest(manifest, views), "session request");
  const probes = findProbes(manifest, sessionRequest, restPositions);
  const followed = unite(raw, [...probes.flatMap((probe) => probe ?? []), ...touching(sessionRequest)]);
  const places = new Map(Array.from(followed, (vertex, place) => [vertex, place]));
  const surfaces = raw.map(({ vertices, weights, ...surface }) => ({
    ...surface,
    follows: vertices === null || weights === null ? null : { places: Uint32Array.from(vertices, (v) => places.get(v) ?? 0), weights },
  }));
  checkSkinVertices(manifest, surfaces);
  return {
    manifest,
    surfaces,
    sessionRequest,
    materialRanges: readRanges(manifest, views),
    followed,
    probes,
    restPositions,
    meshPayload: payload,
    meshSource: source,
    source,
    sticking: readSticking(manifest, sessionRequest, views),
    parted: null,
  };
}

type RawSurface = Omit<CaseSurface, "follows"> & { vertices: Int32Array | null; weights: Float32Array | null };

function readSurface(entry: SurfaceEntry, manifest: Manifest, container: Container, views: Views): RawSurface {
  const ranges = container.meshes[entry.mesh];
  const positions = new Float32Array(views.range(ranges.positions));
  const triangles = new Uint32Array(views.range(ranges.triangles));
  const count = positions.length / 3;
  if (!positions.every(Number.isFinite)) throw new CaseError(`the surface "${entry.name}" has a position that is not a number`);
  if (!triangles.every((vertex) => vertex < count)) throw new CaseError(`the surface "${entry.name}" has a triangle with a vertex past its ${count}`);
  const regions = entry.regions === null ? null : new Uint8Array(views.view(entry.regions));
  if (regions !== null && regions.length < count) throw new CaseError(`the surface "${entry.name}" has no region for each of its ${count} vertices`);
  return { entry, positions, triangles, regions, ...readFollows(entry, manifest, views, count) };
}

function readFollows(entry: SurfaceEntry, manifest: Manifest, views: Views, count: number): Pick<RawSurface, "vertices" | "weights"> {
  if (entry.follows === null) return { vertices: null, weights: null };
  const expectedBytes = 12 * count;
  const vertexBytes = views.view(entry.follows.vertices);
  const weightBytes = views.view(entry.follows.weights);
  if (vertexBytes.byteLength !== expectedBytes || weightBytes.byteLength !== expectedBytes) {
    throw new CaseError(`the surface "${entry.name}" needs three vertices and three weights for each of its ${count} vertices`);
  }
  const vertices = new Int32Array(vertexBytes);
  const weights = new Float32Array(weightBytes);
  if (!vertices.every((vertex) => vertex >= 0 && vertex < manifest.mesh.vertexCount)) {
    throw new CaseError(`the surface "${entry.name}" follows a vertex that the mesh of ${manifest.mesh.vertexCount} vertices does not have`);
  }
  for (let i = 0; i < weights.length; i += 3) {
    const [a, b, c] = [weights[i], weights[i + 1], weights[i + 2]];
    if (!(a >= 0 && b >= 0 && c >= 0 && a + b + c <= 1.001)) throw new CaseError(`the surface "${entry.name}" has weights that are below 0 or over 1`);
  }
  return { vertices, weights };
}

/** The vertices of contact rows that may lift off. */
function touching({ contact }: CreateSessionRequest): number[] {
  return contact.filter(({ bilateral }) => !bilateral).flatMap(({ vertex, other }) => (other.case === "otherVertex" ? [vertex, other.value] : [vertex]));
}

function unite(surfaces: RawSurface[], more: readonly number[]): Int32Array {
  const all = new Set(more);
  for (const { vertices, weights } of surfaces) {
    vertices?.forEach((vertex, i) => {
      if (weights !== null && weights[i] > 0) all.add(vertex);
    });
  }
  return Int32Array.from(all).sort();
}

function findProbes(manifest: Manifest, request: CreateSessionRequest, rest: Float32Array): CaseFile["probes"] {
  return manifest.handles.map(({ name }) => {
    const vertices = request.handles.find((handle) => handle.name === name)?.vertices ?? [];
    return spreadTriple(rest, vertices.filter((vertex) => vertex >= 0 && vertex < manifest.mesh.vertexCount));
  });
}

function checkSkinVertices(manifest: Manifest, surfaces: CaseSurface[]): void {
  const skin = surfaces.find((surface) => surface.entry.kind === "skin");
  const count = skin === undefined ? 0 : skin.positions.length / 3;
  for (const landmark of manifest.landmarks) {
    if (landmark.skinVertex !== null && landmark.skinVertex >= count) {
      throw new CaseError(`the landmark "${landmark.name}" names a vertex that the skin of ${count} vertices does not have`);
    }
  }
}

function readRequest(manifest: Manifest, views: Views): CreateSessionRequest {
  const request = fromBinary(CreateSessionRequestSchema, new Uint8Array(views.view(manifest.sessionRequest)));
  const names = request.handles.map((handle) => handle.name).sort().join("\n");
  if (request.mesh !== manifest.mesh.name || names !== manifest.handles.map((handle) => handle.name).sort().join("\n")) {
    throw new CaseError("the case's session request has another mesh or other handles than the case");
  }
  if (touching(request).some((vertex) => vertex < 0 || vertex >= manifest.mesh.vertexCount)) {
    throw new CaseError("the case's session request has a contact row with a vertex that the mesh does not have");
  }
  if (request.contact.length !== (manifest.contact?.rows ?? 0)) {
    throw new CaseError(`the case's session request has ${request.contact.length} contact rows, and the case says ${manifest.contact?.rows ?? 0}`);
  }
  return request;
}

function readSticking(manifest: Manifest, request: CreateSessionRequest, views: Views): Int32Array {
  const index = manifest.contact?.sticking ?? null;
  if (index === null) return new Int32Array();
  const bytes = views.view(index);
  const pairs = new Int32Array(bytes.slice(0, bytes.byteLength - (bytes.byteLength % 8)));
  const isGood = (vertex: number, i: number) =>
    i % 2 === 1 ? vertex >= -1 && vertex < request.handles.length : vertex > (i === 0 ? -1 : pairs[i - 2]) && vertex < manifest.mesh.vertexCount;
  if (pairs.byteLength !== bytes.byteLength || !pairs.every(isGood)) throw new CaseError("the case's vertices that stick without contact are damaged: make the file again with tissueform case pack");
  return pairs;
}

function readRanges(manifest: Manifest, views: Views): MaterialRanges | null {
  const index = manifest.materialRanges;
  if (index === null) return null;
  return parseMessage(() => fromBinary(MaterialRangesSchema, new Uint8Array(views.view(index))), "ranges of the material");
}

function parseMessage<T>(parse: () => T, what: string): T {
  try {
    return parse();
  } catch (thrown) {
    if (thrown instanceof CaseError) throw thrown;
    throw new CaseError(`the case's ${what} cannot be read: make the file again with tissueform case pack`);
  }
}
