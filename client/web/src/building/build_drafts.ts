// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { toCallError } from "../calls/call_error";
import { readParts } from "../calls/file_parts";
import type { Gateway } from "../calls/gateway";
import type { BuildDraft } from "../generated/tissueform/v1/plan_build_service_pb";
import type { DroppedFile } from "../volume/opened_ct";

// Received CTs that wait on the server until a person builds a plan from them.

const PAGE_SIZE = 200;
const MOST_BYTES = 4 * 2 ** 30;

type Drafts = { planBuilds: Pick<Gateway["planBuilds"], "listBuildDrafts" | "getBuildDraft" | "readBuildDraft" | "deleteBuildDraft"> };

/** Those that nothing was built of, in the order in which they came. Rejects with a CallError. */
export async function listDrafts(gateway: Drafts): Promise<BuildDraft[]> {
  const drafts: BuildDraft[] = [];
  let pageToken = "";
  try {
    do {
      const page = await gateway.planBuilds.listBuildDrafts({ pageSize: PAGE_SIZE, pageToken });
      drafts.push(...page.drafts);
      pageToken = page.nextPageToken;
    } while (pageToken !== "");
  } catch (thrown) {
    throw toCallError(thrown);
  }
  return drafts.filter(({ cases }) => cases.length === 0);
}

/** With its recipe. Rejects with a CallError. */
export async function fetchDraft(gateway: Drafts, name: string): Promise<BuildDraft> {
  return gateway.planBuilds.getBuildDraft({ name }).catch((thrown) => Promise.reject(toCallError(thrown)));
}

/** Its CT, as if it had been dropped. Rejects with a CallError. */
export async function readDraft(gateway: Drafts, { name, suffix }: BuildDraft, onProgress: (share: number) => void): Promise<DroppedFile[]> {
  const file = await readParts((signal) => gateway.planBuilds.readBuildDraft({ name }, { timeoutMs: 0, signal }), "the CT", MOST_BYTES, onProgress);
  return [{ path: `ct${suffix}`, file }];
}

/** With its CT. Rejects with a CallError. */
export async function removeDraft(gateway: Drafts, name: string): Promise<void> {
  await gateway.planBuilds.deleteBuildDraft({ name }).catch((thrown) => Promise.reject(toCallError(thrown)));
}

/** When it came and until when it waits. */
export function draftTimes({ createTime, expireTime }: Pick<BuildDraft, "createTime" | "expireTime">, language?: string): string {
  const day = (seconds: bigint | undefined) => new Date(1000 * Number(seconds ?? 0n)).toLocaleDateString(language, { day: "numeric", month: "short" });
  return `received ${day(createTime?.seconds)}, kept until ${day(expireTime?.seconds)}`;
}
