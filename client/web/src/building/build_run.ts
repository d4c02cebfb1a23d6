// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { toCallError } from "../calls/call_error";
import { readParts } from "../calls/file_parts";
import type { Gateway } from "../calls/gateway";
import { type PlanBuild, PlanBuildService, PlanBuildState } from "../generated/tissueform/v1/plan_build_service_pb";
import { removeBuildFile, uploadBuildFile } from "../live/build_upload";
import { clipTitle } from "../live/upload";

const PAGE_SIZE = 100;
/** A watch that breaks off is begun again; a server that is gone for longer than this many times in a row is reported. */
const MOST_WATCHES = 8;
const WATCH_AGAIN_MS = 1500;
const MOST_FILE_BYTES = 64 * 2 ** 20;

export interface BuildInput {
  readonly recipeText: string;
  /** The CT, or the draft on the server that has it. */
  readonly ct: Blob | { readonly draft: string };
  /** Null: no label map. */
  readonly labels: Blob | null;
  readonly title: string;
  /** The same again begins no second build. */
  readonly requestId: string;
}

export function isDone({ state }: Pick<PlanBuild, "state">): boolean {
  return state === PlanBuildState.SUCCEEDED || state === PlanBuildState.FAILED || state === PlanBuildState.CANCELLED;
}

/** The caller's builds, newest first. Rejects with a CallError. */
export async function listBuilds(gateway: Pick<Gateway, "planBuilds">): Promise<PlanBuild[]> {
  const builds: PlanBuild[] = [];
  let pageToken = "";
  try {
    do {
      const page = await gateway.planBuilds.listPlanBuilds({ pageSize: PAGE_SIZE, pageToken });
      builds.push(...page.builds);
      pageToken = page.nextPageToken;
    } while (pageToken !== "");
  } catch (thrown) {
    throw toCallError(thrown);
  }
  return builds.reverse();
}

/** Sends what is to be sent and begins the build. Where `signal` ends it before the build has begun, the server keeps nothing. Rejects with a CallError or with the reason of `signal`. */
export async function beginBuild(gateway: Gateway, input: BuildInput, onProgress: (share: number) => void, signal: AbortSignal): Promise<PlanBuild> {
  const sent: string[] = [];
  const send = async (blob: Blob, suffix: string, onShare: (share: number) => void) => {
    const name = await uploadBuildFile(gateway, blob, suffix, onShare, signal);
    sent.push(name);
    return name;
  };
  const ctBytes = input.ct instanceof Blob ? input.ct.size : 0;
  const total = ctBytes + (input.labels?.size ?? 0);
  let ct = {};
  let labels = "";
  try {
    ct = input.ct instanceof Blob ? { ct: await send(input.ct, ".nrrd", (share) => onProgress((share * ctBytes) / total)) } : input.ct;
    if (input.labels !== null) labels = await send(input.labels, ".seg.nrrd", (share) => onProgress((ctBytes + share * (total - ctBytes)) / total));
    signal.throwIfAborted();
  } catch (thrown) {
    if (signal.aborted) await Promise.all(sent.map((name) => removeBuildFile(gateway, name)));
    throw thrown;
  }
  try {
    return await gateway.planBuilds.createPlanBuild({ recipeJson: input.recipeText, ...ct, labels, title: clipTitle(input.title), requestId: input.requestId });
  } catch (thrown) {
    throw toCallError(thrown);
  }
}

/** Reports the build as it goes on; resolves with it once it is done. Rejects with a CallError or with the reason of `signal`. */
export async function watchBuild(gateway: Gateway, name: string, onBuild: (build: PlanBuild) => void, signal: AbortSignal): Promise<PlanBuild> {
  let last: PlanBuild | null = null;
  const take = (build: PlanBuild) => {
    last = build;
    onBuild(build);
  };
  for (let fails = 0; last === null || !isDone(last); ) {
    const before: PlanBuild | null = last;
    try {
      await gateway.stream(PlanBuildService.method.watchPlanBuild, { $typeName: "tissueform.v1.WatchPlanBuildRequest", name }, take, { signal });
    } catch (thrown) {
      signal.throwIfAborted();
      const error = toCallError(thrown);
      fails = last === before ? fails + 1 : 0;
      if (!error.isPassing || fails > MOST_WATCHES) throw error;
      await new Promise((resolve) => setTimeout(resolve, WATCH_AGAIN_MS));
    }
  }
  return last;
}

/** Ends a build and removes it; one that is done before stays with its case. Rejects with a CallError. */
export async function discardBuild(gateway: Gateway, name: string): Promise<void> {
  try {
    await gateway.planBuilds.cancelPlanBuild({ name });
    const { state } = await watchBuild(gateway, name, () => {}, new AbortController().signal);
    if (state === PlanBuildState.CANCELLED) await gateway.planBuilds.deletePlanBuild({ name });
  } catch (thrown) {
    throw toCallError(thrown);
  }
}

/** One file of what was made. Rejects with a CallError. */
export async function readBuiltFile(gateway: Pick<Gateway, "planBuilds">, name: string, path: string): Promise<Uint8Array<ArrayBuffer>> {
  const file = await readParts((signal) => gateway.planBuilds.readPlanBuildFile({ name, path }, { timeoutMs: 0, signal }), path, MOST_FILE_BYTES);
  return new Uint8Array(await file.arrayBuffer());
}
