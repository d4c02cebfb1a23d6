// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type MessageInitShape, create } from "@bufbuild/protobuf";
import { type CreateSessionRequest, CreateSessionRequestSchema } from "../generated/tissueform/v1/session_service_pb";
import type { CaseFile, CaseSource } from "./case_file";
import { CaseError } from "./field";
import type { Manifest } from "./manifest";
import { subtleCrypto } from "./secure_page";
import { firstAtPlace, keptCount, withSticking } from "./sticking";

/**
 * The same case without contact, as `--contact off` makes it: tissue sticks to bone, and the lips are one piece. Its mesh is another
 * one, without the doubles of the seam. Rejects with an Error on pages where browsers digest nothing, and with a CaseError where the
 * lips cannot be joined.
 */
export async function stickingCase(file: CaseFile): Promise<CaseFile> {
  const { manifest, sessionRequest: request, meshPayload } = file;
  const payload = await file.meshSource.read(meshPayload.offset, meshPayload.length);
  const { vertexCount } = manifest.mesh;
  const first = firstAtPlace(new Float64Array(payload.slice(0, 24 * vertexCount).buffer), request.contact);
  const welded = weld(payload, manifest.mesh, first);
  const mesh = await meshOf(welded, manifest.mesh, keptCount(first));
  return {
    ...file,
    ...renumbered(file, first),
    manifest: { ...manifest, mesh, contact: null },
    sessionRequest: stickingRequest(request, file.sticking, mesh.name),
    restPositions: file.restPositions.slice(0, 3 * mesh.vertexCount),
    meshPayload: { offset: 0, length: welded.length },
    meshSource: bytesSource(welded),
    sticking: new Int32Array(),
    parted: file,
  };
}

/** The mesh's bytes (docs/case-format.md) without the doubles. */
function weld(payload: Uint8Array<ArrayBuffer>, { vertexCount, tetCount }: Manifest["mesh"], first: Int32Array): Uint8Array<ArrayBuffer> {
  const kept = keptCount(first);
  if (first.subarray(0, kept).some((vertex, i) => vertex !== i)) throw new CaseError("the lips cannot be joined: the doubles of the seam are not the last vertices");
  const cells = payload.slice(24 * vertexCount);
  const tets = new Int32Array(cells.buffer, 0, 4 * tetCount);
  if (!tets.every((vertex) => vertex >= 0 && vertex < vertexCount)) throw new CaseError("the case's mesh has a tet with a vertex that it does not have");
  tets.forEach((vertex, i) => (tets[i] = first[vertex]));
  const welded = new Uint8Array(24 * kept + cells.length);
  welded.set(payload.subarray(0, 24 * kept));
  welded.set(cells, 24 * kept);
  return welded;
}

/** Named as servers name it: by the SHA-256 of its shape and its bytes. */
async function meshOf(payload: Uint8Array<ArrayBuffer>, mesh: Manifest["mesh"], vertexCount: number): Promise<Manifest["mesh"]> {
  const encoder = new TextEncoder();
  const arrays = mesh.cellArrays.map((name) => `cell_array ${encoder.encode(name).length} ${name}\n`).join("");
  const shape = encoder.encode(`tissueform-mesh 1\nvertices ${vertexCount}\ntets ${mesh.tetCount}\n${arrays}`);
  const all = new Blob([shape, payload]);
  const digest = new Uint8Array(await subtleCrypto("joins the lips").digest("SHA-256", await all.arrayBuffer()));
  const name = `meshes/${Array.from(digest, (byte) => byte.toString(16).padStart(2, "0")).join("")}`;
  return { ...mesh, name, vertexCount };
}

function stickingRequest(request: CreateSessionRequest, sticking: Int32Array, mesh: string): CreateSessionRequest {
  const value: MessageInitShape<typeof CreateSessionRequestSchema> = {
    ...request,
    mesh,
    contact: [],
    lipEdge: undefined,
    fixedVertices: withSticking(request.fixedVertices, sticking, -1),
    handles: request.handles.map((handle, index) => ({ ...handle, vertices: withSticking(handle.vertices, sticking, index) })),
  };
  return create(CreateSessionRequestSchema, value);
}

/** What names vertices of the mesh, or places in `followed`. */
function renumbered({ followed, surfaces, probes }: CaseFile, first: Int32Array): Pick<CaseFile, "followed" | "surfaces" | "probes"> {
  const joined = Int32Array.from(new Set(followed.map((vertex) => first[vertex]))).sort();
  const places = new Map(Array.from(joined, (vertex, place) => [vertex, place]));
  const placeOf = (place: number) => places.get(first[followed[place]]) ?? 0;
  return {
    followed: joined,
    surfaces: surfaces.map((surface) => ({ ...surface, follows: surface.follows && { ...surface.follows, places: surface.follows.places.map(placeOf) } })),
    probes: probes.map((probe) => probe && [first[probe[0]], first[probe[1]], first[probe[2]]]),
  };
}

function bytesSource(bytes: Uint8Array<ArrayBuffer>): CaseSource {
  return { totalBytes: bytes.length, read: (offset, length) => Promise.resolve(bytes.slice(offset, offset + length)) };
}
