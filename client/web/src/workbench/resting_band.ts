// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { toCallError } from "../calls/call_error";
import { type Gateway, sessionMetadata } from "../calls/gateway";
import type { CaseFile } from "../case/case_file";
import type { DeformOnceResponse } from "../generated/tissueform/v1/deform_service_pb";
import type { DeformationModel } from "../generated/tissueform/v1/session_pb";
import type { Pose } from "../geometry/pose";
import { toMessages } from "../live/pose_messages";

/** The hand rests: each question costs the server seconds. */
const REST_MS = 600;
const DEADLINE_MS = 300_000;

/** Of each of CaseFile.followed the material’s part of the 95 % interval, mm; null and the reason where it is not known. */
export interface RestingBand {
  bandMm: Float32Array | null;
  reason: string;
}

/** Whose answer it is. */
export interface BandQuestion {
  file: CaseFile;
  session: string;
  model: DeformationModel;
  poses: Pose[];
}

/** Where tissue touches, the server finds the band of one answer. Waits for the hand to rest; rejects once `signal` is aborted. */
export async function findBand(gateway: Gateway, ask: () => BandQuestion, signal: AbortSignal): Promise<RestingBand> {
  await new Promise((resolve) => setTimeout(resolve, REST_MS));
  signal.throwIfAborted();
  const { file, session, model, poses } = ask();
  const names = file.manifest.handles.map(({ name }) => name);
  const vertices = { selection: { case: "list" as const, value: { vertices: Array.from(file.followed) } } };
  const request = { session, model, poses: toMessages(names, poses), vertices, ranges: file.materialRanges ?? undefined };
  const answer = await gateway.deform.deformOnce(request, { headers: sessionMetadata(session), timeoutMs: DEADLINE_MS, signal }).catch((thrown: unknown) => {
    throw toCallError(thrown);
  });
  return readBand(answer, file.followed.length);
}

function readBand({ uncertaintyP95Mm: bytes, noUncertainty: reason }: DeformOnceResponse, count: number): RestingBand {
  if (bytes.length === 0) return { bandMm: null, reason };
  if (bytes.length !== 4 * count) throw new Error("the answer has another number of vertices than requested");
  return { bandMm: new Float32Array(bytes.slice().buffer), reason: "" };
}
