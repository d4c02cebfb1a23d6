// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { create } from "@bufbuild/protobuf";
import { Code, toCallError } from "../calls/call_error";
import type { Gateway } from "../calls/gateway";
import { repeated } from "../calls/repetition";
import { fileSource, sha256Of } from "../case/case_sources";
import { type BuildFile, PlanBuildService, UploadBuildFileRequestSchema } from "../generated/tissueform/v1/plan_build_service_pb";
import { type Progress, sendChunks } from "./upload";

/**
 * Sends a file that a plan is built from, from where an earlier upload of the same bytes broke off; done at once where the server
 * has it. Resolves with its name, "buildFiles/{sha256}". Resumes by itself if the server goes away during the upload. Rejects with a
 * CallError, or with the reason of `signal`, which also removes what has arrived.
 */
export async function uploadBuildFile(gateway: Gateway, file: Blob, suffix: string, onProgress: Progress, signal: AbortSignal): Promise<string> {
  const sha256 = await sha256Of(file);
  signal.throwIfAborted();
  const header = { sha256, totalBytes: BigInt(file.size), suffix };
  try {
    return await repeated(async () => (await send(gateway, file, header, onProgress, signal)).name, (error) => !signal.aborted && error.isPassing);
  } catch (thrown) {
    if (signal.aborted) await removeBuildFile(gateway, `buildFiles/${sha256}`);
    throw thrown;
  }
}

/** Best effort: a server that does not answer removes it after a day. */
export async function removeBuildFile(gateway: Gateway, name: string): Promise<void> {
  await gateway.planBuilds.deleteBuildFile({ name }).catch(() => {});
}

async function send(gateway: Gateway, file: Blob, header: { sha256: string; totalBytes: bigint; suffix: string }, onProgress: Progress, signal: AbortSignal): Promise<BuildFile> {
  const known = await committed(gateway, `buildFiles/${header.sha256}`);
  const begun = Number(known?.committedBytes ?? 0n);
  signal.throwIfAborted();
  if (known !== null && begun === file.size) {
    onProgress(1);
    return known;
  }
  let answer: BuildFile | null = null;
  await new Promise<void>((resolve, reject) => {
    const call = gateway.open(PlanBuildService.method.uploadBuildFile, {
      onMessage: (message) => (answer = message),
      onEnd: (error) => (error === null ? resolve() : reject(error)),
    });
    const stop = (reason: unknown) => {
      call.cancel();
      reject(reason);
    };
    signal.addEventListener("abort", () => stop(signal.reason));
    call.send(create(UploadBuildFileRequestSchema, { message: { case: "header", value: { $typeName: "tissueform.v1.BuildFileHeader", ...header } } }));
    const sendChunk = (offset: number, data: Uint8Array, finishWrite: boolean) => {
      const value = { $typeName: "tissueform.v1.BuildFileChunk" as const, writeOffset: BigInt(begun + offset), data, finishWrite };
      call.send(create(UploadBuildFileRequestSchema, { message: { case: "chunk", value } }));
    };
    const rest = { offset: begun, length: file.size - begun };
    sendChunks(call, fileSource(file), rest, sendChunk, () => answer !== null, (share) => onProgress((begun + share * rest.length) / file.size)).catch(stop);
  });
  if (answer === null) throw new Error("the server has taken the file without an answer: try again");
  return answer;
}

/** Null where the server has nothing of it. */
async function committed(gateway: Gateway, name: string): Promise<BuildFile | null> {
  try {
    return await gateway.planBuilds.getBuildFile({ name });
  } catch (thrown) {
    const error = toCallError(thrown);
    if (error.code === Code.NotFound) return null;
    throw error;
  }
}
