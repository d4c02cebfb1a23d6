// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { expect, test } from "vitest";
import { draftTimes, listDrafts, readDraft } from "../../src/building/build_drafts";
import { PlanDraft } from "../../src/building/plan_draft";
import type { Volume } from "../../src/volume/volume";

const PAGES: Record<string, object> = {
  "": { drafts: [{ name: "buildDrafts/1", cases: [] }, { name: "buildDrafts/2", cases: ["cases/a"] }], nextPageToken: "more" },
  more: { drafts: [{ name: "buildDrafts/3", cases: [] }], nextPageToken: "" },
};
const gateway = {
  planBuilds: {
    listBuildDrafts: async ({ pageToken }: { pageToken: string }) => PAGES[pageToken],
    async *readBuildDraft({ name }: { name: string }) {
      yield { offset: 0n, data: new TextEncoder().encode(name), totalBytes: BigInt(name.length) };
    },
  },
} as any;

const VOLUME: Volume = { grid: { size: [2, 2, 2], spacing: [1, 1, 1], origin: [0, 0, 0], directions: [[1, 0, 0], [0, 1, 0], [0, 0, 1]] }, values: new Int16Array(8), kernel: "" };

test("those that nothing was built of are listed, over all pages", async () => {
  expect((await listDrafts(gateway)).map(({ name }) => name)).toEqual(["buildDrafts/1", "buildDrafts/3"]);
});

test("a draft is read as a file of its format, whose name names nothing", async () => {
  const [file] = await readDraft(gateway, { name: "buildDrafts/1", suffix: ".mha" } as any, () => {});
  expect(file.path).toBe("ct.mha");
  expect(await file.file.text()).toBe("buildDrafts/1");
});

test("days are said in words", () => {
  const at = (day: string) => ({ seconds: BigInt(Date.parse(day) / 1000), nanos: 0 }) as any;
  expect(draftTimes({ createTime: at("2026-11-28T12:00:00Z"), expireTime: at("2026-12-12T12:00:00Z") }, "en-GB")).toBe("received 28 Nov, kept until 12 Dec");
});

test("a CT that is dropped later is no longer that of the draft", () => {
  const draft = new PlanDraft();
  draft.setVolume(VOLUME, null, "buildDrafts/1");
  expect(draft.received).toBe("buildDrafts/1");
  draft.setVolume(VOLUME, null);
  expect(draft.received).toBeNull();
});
