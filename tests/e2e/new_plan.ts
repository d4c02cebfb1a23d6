// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { gzipSync } from "node:zlib";
import type { Page } from "playwright-core";
import { openPage } from "./planner";

// The page of a new plan, with volumes made of the bundled head or of noise.

const HEAD = fileURLToPath(new URL("../data/ct/headsq/headsq_quarter.raw.gz", import.meta.url));

function nrrdHeader(sizes: string, directions: string, origin: readonly number[] = [0, 0, 0]): string {
  return ["NRRD0004", "type: int16", "dimension: 3", "space: left-posterior-superior", `sizes: ${sizes}`, `space directions: ${directions}`, "endian: little", "encoding: gzip", `space origin: (${origin.join(",")})`, "", ""].join("\n");
}

/** The bundled head, with patient directions as the recipes of tests/data/plans give them ("RPI"). */
export function writeHead(folder: string, origin: readonly number[] = [0, 0, 0]): string {
  const path = join(folder, "head.nrrd");
  writeFileSync(path, Buffer.concat([Buffer.from(nrrdHeader("64 64 93", "(-3.2,0,0) (0,3.2,0) (0,0,-1.5)", origin)), readFileSync(HEAD)]));
  return path;
}

/** A volume of noise without bone, which hardly compresses: megabytes to send. */
export function writeNoise(folder: string): string {
  const path = join(folder, "noise.nrrd");
  let state = 1;
  const values = Int16Array.from({ length: 200 * 200 * 150 }, () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return -1000 + ((state >>> 16) % 1200);
  });
  writeFileSync(path, Buffer.concat([Buffer.from(nrrdHeader("200 200 150", "(1,0,0) (0,1,0) (0,0,1)")), gzipSync(Buffer.from(values.buffer), { level: 1 })]));
  return path;
}

/** The recipe of the bundled head, as the page and the command line take it. */
export const HEAD_RECIPE = { format: "tissueform-recipe", version: 7, ct: { hu_offset: -1024 }, segments: [{ name: "mandible", osteotomy: "bssro", pose: { translation_mm: [0, -6, 0] } }] };

export async function openNewPlan(context: Parameters<typeof openPage>[0], url: string): Promise<{ page: Page; faults: string[] }> {
  const opened = await openPage(context, `${url}/#new`);
  await opened.page.getByRole("heading", { name: "New plan from a CT" }).waitFor();
  return opened;
}

export async function goToStep(page: Page, name: string): Promise<void> {
  await page.getByRole("navigation", { name: "Steps" }).getByRole("button", { name }).click();
}

/** Everything before the build: a CT and a recipe. */
export async function prepare(page: Page, ct: string, recipe: object = HEAD_RECIPE): Promise<void> {
  await page.getByLabel("Choose files").setInputFiles(ct);
  await page.locator(".plan-views").waitFor();
  await page.evaluate((wanted) => (globalThis as any).tissueform.draft.change(wanted), recipe);
  await goToStep(page, "Build");
}
