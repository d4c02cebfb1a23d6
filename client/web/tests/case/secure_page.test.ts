// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { afterEach, expect, test, vi } from "vitest";
import { sha256Of } from "../../src/case/case_sources";
import { seal } from "../../src/movingdata/sealed_payload";
import { reportFile } from "../../src/report/report_file";

afterEach(() => vi.unstubAllGlobals());

// An http page of another computer, as browsers have it.
test.each<[string, () => Promise<unknown>, string]>([
  ["a dropped case", () => sha256Of(new Blob(["case"])), "this browser checks files on https pages only: open the planner by https, or publish the case with tissueform case publish"],
  ["the report", () => reportFile({ outerHTML: "" } as HTMLElement), "this browser writes the report as a file on https pages only: open the planner by https, or print the report"],
  ["a file that moves", () => seal(new Uint8Array([1]), ""), "this browser writes moving files on https pages only: open the planner by https"],
  ["one with a password", () => seal(new Uint8Array([1]), "a long password"), "this browser writes moving files on https pages only: open the planner by https"],
])("without https %s is refused in a sentence", async (_, run, sentence) => {
  vi.stubGlobal("crypto", { getRandomValues: (bytes: Uint8Array) => bytes });
  await expect(run()).rejects.toThrow(sentence);
});
