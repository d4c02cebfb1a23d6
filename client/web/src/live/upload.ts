// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { create } from "@bufbuild/protobuf";
import { CallError } from "../calls/call_error";
import { type Gateway, sessionMetadata } from "../calls/gateway";
import { repeated } from "../calls/repetition";
import { type CaseSource } from "../case/case_file";
import type { Range } from "../case/container";
import type { Manifest } from "../case/manifest";
import { type Case, CaseSchema } from "../generated/tissueform/v1/case_pb";
import { CaseService, UploadCaseRequestSchema, type UploadCaseResponse } from "../generated/tissueform/v1/case_service_pb";
import { MeshService, UploadMeshRequestSchema, type UploadMeshResponse } from "../generated/tissueform/v1/mesh_service_pb";
import type { CallSocket } from "../calls/call_socket";

const CHUNK_BYTES = 2 ** 20;
/** What may wait in the page at most: a slow line holds the reading of the file up, not the page's memory. */
const MOST_BUFFERED_BYTES = 4 * 2 ** 20;
const BUFFER_POLL_MS = 10;

export type Progress = (share: number) => void;

/**
 * Sends a case, whose bytes have the SHA-256 `sha256`; done at once where the server has it. Sent once more if the server goes
 * away during the upload. Rejects with a CallError.
 */
export function uploadCase(gateway: Gateway, source: CaseSource, sha256: string, title: string, onProgress: Progress): Promise<Case> {
  return repeated(() => sendCase(gateway, source, sha256, title, onProgress), (error) => error.isOfServer);
}

async function sendCase(gateway: Gateway, source: CaseSource, sha256: string, title: string, onProgress: Progress): Promise<Case> {
  let answer: UploadCaseResponse | null = null;
  await new Promise<void>((resolve, reject) => {
    const call = gateway.open(CaseService.method.uploadCase, {
      onMessage: (message) => (answer = message),
      onEnd: (error) => (error === null ? resolve() : reject(error)),
    });
    const header = { sha256, totalBytes: BigInt(source.totalBytes), title: clipTitle(title) };
    call.send(create(UploadCaseRequestSchema, { message: { case: "header", value: header } }));
    const sendChunk = (offset: number, data: Uint8Array, finishWrite: boolean) => {
      const value = { $typeName: "tissueform.v1.CaseChunk" as const, writeOffset: BigInt(offset), data, finishWrite };
      call.send(create(UploadCaseRequestSchema, { message: { case: "chunk", value } }));
    };
    sendChunks(call, source, { offset: 0, length: source.totalBytes }, sendChunk, () => answer !== null, onProgress).catch((error) => {
      call.cancel();
      reject(error);
    });
  });
  return (answer as UploadCaseResponse | null)?.case ?? create(CaseSchema, { name: `cases/${sha256}`, title });
}

/**
 * Sends the mesh of a case, from where an earlier upload broke off. What has not arrived in full is on one server: all calls of
 * a mesh go to the same one, by its name. Rejects with a CallError.
 */
export async function uploadMesh(gateway: Gateway, source: CaseSource, payload: Range, mesh: Manifest["mesh"], onProgress: Progress): Promise<void> {
  const committed = await committedBytes(gateway, mesh.name);
  let answer: UploadMeshResponse | null = null;
  await new Promise<void>((resolve, reject) => {
    const call = gateway.open(MeshService.method.uploadMesh, {
      onMessage: (message) => (answer = message),
      onEnd: (error) => (error === null ? resolve() : reject(error)),
    }, { metadata: sessionMetadata(mesh.name) });
    const header = {
      $typeName: "tissueform.v1.MeshHeader" as const,
      vertexCount: BigInt(mesh.vertexCount),
      tetCount: BigInt(mesh.tetCount),
      cellArrays: mesh.cellArrays,
      totalBytes: BigInt(payload.length),
      sha256: mesh.name.replace("meshes/", ""),
    };
    call.send(create(UploadMeshRequestSchema, { message: { case: "header", value: header } }));
    const sendChunk = (offset: number, data: Uint8Array, finishWrite: boolean) => {
      const value = { $typeName: "tissueform.v1.MeshChunk" as const, writeOffset: BigInt(offset + committed), data, finishWrite };
      call.send(create(UploadMeshRequestSchema, { message: { case: "chunk", value } }));
    };
    const rest = { offset: payload.offset + committed, length: payload.length - committed };
    sendChunks(call, source, rest, sendChunk, () => answer !== null, onProgress).catch((error) => {
      call.cancel();
      reject(error);
    });
  });
}

async function committedBytes(gateway: Gateway, name: string): Promise<number> {
  try {
    return Number((await gateway.meshes.queryUpload({ name }, { headers: sessionMetadata(name) })).committedBytes);
  } catch {
    return 0;
  }
}

/** The range in chunks whose offsets count from its beginning; stops where the server has answered. */
export async function sendChunks(
  call: Pick<CallSocket<typeof CaseService.method.uploadCase>, "bufferedBytes" | "halfClose" | "isOver">,
  source: CaseSource,
  range: Range,
  send: (offset: number, data: Uint8Array, isLast: boolean) => void,
  isAnswered: () => boolean,
  onProgress: Progress,
): Promise<void> {
  for (let at = 0; at === 0 || at < range.length; at += CHUNK_BYTES) {
    // What a dead connection holds never leaves it.
    while (call.bufferedBytes > MOST_BUFFERED_BYTES && !call.isOver) await new Promise((resolve) => setTimeout(resolve, BUFFER_POLL_MS));
    const length = Math.min(CHUNK_BYTES, range.length - at);
    const data = await source.read(range.offset + at, length);
    if (isAnswered() || call.isOver) return;
    send(at, data, at + length >= range.length);
    onProgress(range.length === 0 ? 1 : (at + length) / range.length);
  }
  call.halfClose();
}

const MOST_TITLE_BYTES = 256;

/** As much of a title as servers keep: whole characters of at most 256 bytes. */
export function clipTitle(title: string): string {
  const bytes = new TextEncoder().encode(title);
  if (bytes.length <= MOST_TITLE_BYTES) return title;
  return new TextDecoder().decode(bytes.subarray(0, MOST_TITLE_BYTES)).replace(/\uFFFD+$/, "");
}

/** Whether a call failed because the server does not have what it names. */
export function isMissing(error: unknown, reason: string): boolean {
  return error instanceof CallError && error.reason === reason;
}
