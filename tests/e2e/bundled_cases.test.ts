// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { execFileSync } from "node:child_process";
import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import type { Page } from "playwright-core";
import { type Hook, Planner, moved, openCase, saveExport, takeSegment, typeMove } from "./planner";

// What a browser shows and gives out of the bundled heads, against the command line. The numbers without a browser: numbers.test.ts.

const SOURCE = fileURLToPath(new URL("../..", import.meta.url));
const BIN = join(process.env.TISSUEFORM_BUILD_DIR ?? join(SOURCE, "build/release"), "bin");

let planner: Planner;
beforeAll(async () => (planner = await Planner.start()));
afterAll(() => planner.stop());

/** What the program prints. Throws where it fails. */
function run(program: string, ...options: string[]): string {
  return execFileSync(join(BIN, program), options, { encoding: "utf8" });
}

const readJson = (path: string) => JSON.parse(readFileSync(path, "utf8"));

/** Resolves once the server has answered it. */
async function moveLowerJaw(page: Page): Promise<void> {
  await takeSegment(page, "Lower jaw");
  await typeMove(page, "Forward", "4");
  await typeMove(page, "Pitch", "1");
  await moved(page, 2, 8);
  await page.waitForFunction(() => {
    const { bench } = (globalThis as unknown as Hook).tissueform;
    return bench.waitingMs === 0 && bench.answer.value?.by === "server";
  });
}

const rowOf = ({ pose }: any) => [...pose.rotation_vector_deg.map((degrees: number) => (degrees * Math.PI) / 180), ...pose.pivot_mm, ...pose.translation_mm, pose.scale];

describe.each(["head", "three_segments"])("the bundled case %s", (name) => {
  const source = join(SOURCE, "tests/data/plans", name, "plan.json");
  const at = (file: string) => join(planner.folder, `${name}-${file}`);
  let opened: Awaited<ReturnType<typeof openCase>>;
  beforeAll(async () => {
    run("tissueform", "case", "pack", source, "--out", at("case.tfcase"));
    opened = await openCase(await planner.browse(), planner, at("case.tfcase"));
  });
  afterAll(() => opened.page.context().close());

  test("has no movement at rest in any row of its table", async () => {
    const table = opened.page.locator("section", { hasText: "Movements" }).getByRole("table");
    expect(await table.getByRole("rowheader").allInnerTexts()).toContain("Nose tip");
    expect(new Set(await table.locator("tbody td").allInnerTexts())).toEqual(new Set(["·"]));
    expect(opened.faults).toEqual([]);
  });

  test("gives out a plan that plan check and deform take, with the movements of C++", async () => {
    const { page } = opened;
    await moveLowerJaw(page);
    const table = page.locator("section[aria-label=Movements]");
    await expect.poll(() => table.getByRole("row", { name: /^Soft pogonion/ }).innerText()).toMatch(/of this surgery \d+\.\d, model 1\.\d/);
    await table.getByText("where 95 of 100 patients will be").waitFor();
    // The upper jaw rests, and what misses the plan of the lower jaw does not move it.
    if (name === "head") expect(await table.getByRole("row", { name: /^Upper incisor/ }).innerText()).not.toMatch(/surgery/);
    const path = await saveExport(planner, page, "Plan JSON", "tissueform-plan.json");
    const { landmarks } = readJson(path);
    const chin = landmarks.find((landmark: any) => landmark.name === "soft_pogonion");
    expect(chin.interval_of).toMatch(/^surgery(, model and material| and model)$/);
    expect(chin.lowest_total_mm).toBeLessThan(chin.totalMm);
    expect(chin.highest_total_mm).toBeGreaterThan(chin.totalMm);
    await saveExport(planner, page, "Case file", "tissueform-case.tfcase");
    expect(run("tissueform", "plan", "check", path)).toContain("the plan is ready");
    run("tissueform", "deform", path, "--out", at("exported.vtu"));
    const [exported, original] = [readJson(path), readJson(source)];
    const poseOf = (handle: string) => exported.handles.find((known: any) => known.name === handle).pose;
    const handles = original.handles.map((handle: any) => ({ ...handle, pose: poseOf(handle.name) }));
    writeFileSync(at("plan.json"), JSON.stringify({ ...original, mesh: join(source, "../head.vtu"), handles }));
    run("tissueform", "deform", at("plan.json"), "--allow-outside", "--out", at("original.vtu"));
    const { overall } = JSON.parse(run("tissueform", "compare", at("exported.vtu"), at("original.vtu"), "--json"));
    expect(overall.max_mm).toBeLessThan(1e-9);
    writeFileSync(at("poses.json"), JSON.stringify([handles.map(rowOf)]));
    run("tissueform-predicted-case", source, at("poses.json"), at("numbers.json"), at("numbers.f32"));
    readJson(at("numbers.json"))[0].landmarks.forEach(({ totalMm }: any, index: number) => expect(Math.abs(exported.landmarks[index].totalMm - totalMm)).toBeLessThan(0.01));
    expect(exported.uncertainty.youngs_modulus_factor_95.values).toEqual({ 16000: 1.8, 27000: 2.2, 53000: 2.1 });
    expect(opened.faults).toEqual([]);
  });
});
