// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { execFileSync } from "node:child_process";
import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { fileURLToPath, pathToFileURL } from "node:url";
import type { BrowserContext, Page } from "playwright-core";
import { handMadeCase } from "../../client/web/tests/testing/hand_made_case";
import { type Hook, Planner, live, openCase, saveExport, seriousFindings, typeMove } from "./planner";

// A face whose lips part, and the same without contact against the face made in one piece.

const BIN = join(process.env.TISSUEFORM_BUILD_DIR ?? "../../build/release", "bin");
const LINEAR_ELASTIC = 3;
/** Frames are float32. */
const ROUNDED_MM = 2e-5;
/** Places and weights of moving files are rounded more, and the planner shows prepared answers, too. */
const MOVING_FILE_MM = 0.01;

let planner: Planner;
let context: BrowserContext;
beforeAll(async () => {
  planner = await Planner.start();
  context = await planner.browse();
});
afterAll(() => planner.stop());

async function openFace(name: string, hasContact: boolean): Promise<{ page: Page; faults: string[] }> {
  const path = join(planner.folder, `${name}.tfcase`);
  writeFileSync(path, handMadeCase(hasContact));
  return openCase(context, planner, path);
}

/** Displacements of what the case follows, by the server in full. */
function serverAnswer(page: Page): Promise<number[]> {
  return page.evaluate(async (model) => {
    const { bench } = (globalThis as unknown as Hook).tissueform;
    return Array.from((await bench.answers.ofModel(bench.live.session, model, bench.plan.poses())) as Float32Array);
  }, LINEAR_ELASTIC);
}

const farthest = (a: number[], b: number[]) => (a.length === b.length ? Math.max(...a.map((value, i) => Math.abs(value - b[i]))) : Infinity);

/** How far the vertices of the upper lip have come above their doubles, at most and at least. */
function lipGaps(page: Page): Promise<{ most: number; least: number }> {
  return page.evaluate(async (model) => {
    const { bench } = (globalThis as unknown as Hook).tissueform;
    const { sessionRequest, restPositions } = bench.file;
    const pairs = sessionRequest.contact.filter((row: any) => row.other.case === "otherVertex");
    const vertices = pairs.flatMap((row: any) => [row.other.value, row.vertex]);
    const file = { ...bench.file, followed: Int32Array.from(vertices) };
    const rest = Float32Array.from(vertices.flatMap((vertex: number) => Array.from(restPositions.slice(3 * vertex, 3 * vertex + 3))));
    const asked = Object.assign(Object.create(Object.getPrototypeOf(bench.answers)), bench.answers, { file, rest });
    const moves: Float32Array = await asked.ofModel(bench.live.session, model, bench.jaw.apply(bench.plan.poses()));
    const gaps = pairs.map((_: unknown, i: number) => moves[6 * i + 2] - moves[6 * i + 5]);
    return { most: Math.max(...gaps), least: Math.min(...gaps) };
  }, LINEAR_ELASTIC);
}

const shownPoints = (page: Page) => page.evaluate(() => (globalThis as unknown as Hook).tissueform.view.points.get("contact")?.geometry.attributes.position.count ?? 0);

test("the page says how tissue touches", async () => {
  const { page, faults } = await openFace("lips", true);
  await typeMove(page, "Up", "2");
  await page.getByText(/^Tissue presses at \d+ of \d+ places, with at most 0\.\d+ N at one \(bright points: strong\)\. Lips up to 0\.0 mm apart\.$/).waitFor();
  await page.getByRole("button", { name: "Show contact" }).click();
  await expect.poll(() => shownPoints(page)).toBeGreaterThan(0);
  await page.getByText(/^Tissue presses at \d+ of \d+ places, with at most 0\.\d+ N at one; (?!0\.0 )\d+\.\d kPa on average, (?!0\.0 )\d+\.\d at most \(bright points: strong\)\./).waitFor();
  await typeMove(page, "Up", "-4");
  await page.getByText(/^Tissue presses at 0 of \d+ places\. Lips up to (?!0\.0)\d\.\d mm apart\.$/).waitFor();
  expect(await shownPoints(page)).toBe(0);
  expect(await page.getByLabel("Color by").locator("option").allTextContents()).not.toContain("95 % interval (material)");
  expect(await seriousFindings(page)).toEqual([]);
  expect(faults).toEqual([]);
  await page.close();
});

/** The material’s part that the page shows of the vertices of the skin, and what the command line says of the same. */
async function bothBands(page: Page): Promise<[number[], number[]]> {
  const plan = await saveExport(planner, page, "Plan JSON", "tissueform-plan.json");
  const shown = await page.evaluate(() => {
    const { bench } = (globalThis as unknown as Hook).tissueform;
    const places = bench.file.surfaces[0].follows.places as Uint32Array;
    return Array.from(places, (place): [number, number] => [bench.file.followed[place], bench.shownBand[place]]);
  });
  const out = join(planner.folder, "banded.vtu");
  execFileSync(join(BIN, "tissueform"), ["deform", plan, "--model", "linear_elastic", "--out", out]);
  const read = `import json, meshio; print(json.dumps(meshio.read(${JSON.stringify(out)}).point_data["material_uncertainty_p95_mm"].tolist()))`;
  const said: number[] = JSON.parse(execFileSync("/usr/bin/python3", ["-c", read], { encoding: "utf8" }));
  return [shown.map(([, band]) => band), shown.map(([vertex]) => said[vertex])];
}

test("the material’s part of the interval comes when the hand rests, and is that of the command line", async () => {
  const plan = fileURLToPath(new URL("../data/plans/head_lips/plan.json", import.meta.url));
  const path = join(planner.folder, "head_lips.tfcase");
  execFileSync(join(BIN, "tissueform"), ["case", "pack", plan, "--out", path]);
  const { page, faults } = await openCase(context, planner, path);
  const hasBand = () => page.evaluate(() => Math.max(0, ...((globalThis as unknown as Hook).tissueform.bench.shownBand ?? [])) > 0);
  await page.getByText("Linear elastic", { exact: true }).click();
  await typeMove(page, "Forward", "6");
  await expect.poll(hasBand).toBe(true);
  await saveExport(planner, page, "Case file", "tissueform-case.tfcase");
  const [shown, said] = await bothBands(page);
  // The page's is of first order, the command line's of second.
  const largest = Math.max(...said);
  expect(largest).toBeGreaterThan(0.1);
  expect(farthest(shown, said)).toBeLessThan(0.15 * largest);
  await page.getByLabel("Color by").selectOption({ label: "95 % interval (material)" });
  await typeMove(page, "Forward", "3");
  expect(await hasBand()).toBe(false);
  await expect.poll(hasBand).toBe(true);
  expect(await seriousFindings(page)).toEqual([]);
  expect(faults).toEqual([]);
  await page.close();
});

test("the jaw opens, and the lips part; closed again they touch and do not pass through each other", async () => {
  const { page, faults } = await openFace("lips", true);
  await page.locator("summary").getByText("Jaw and occlusion", { exact: true }).click();
  await page.getByRole("slider", { name: "Jaw rotation" }).fill("12");
  expect((await lipGaps(page)).most).toBeGreaterThan(3);
  await page.getByRole("button", { name: "Close", exact: true }).click();
  await typeMove(page, "Up", "2");
  expect((await lipGaps(page)).least).toBeGreaterThan(-ROUNDED_MM);
  expect(faults).toEqual([]);
  await page.close();
});

/** Heights of the two edges of the seal above each other, at most. */
function edgesApart(page: Page): Promise<number> {
  return page.evaluate(() => {
    const { bench } = (globalThis as unknown as Hook).tissueform;
    const places = new Map(Array.from(bench.file.followed as Int32Array, (vertex, place) => [vertex, place]));
    const up = (vertex: number) => bench.newest.displacements[3 * (places.get(vertex) as number) + 2];
    return Math.max(...bench.file.sessionRequest.lipEdge.pairs.map(({ upper, lower }: any) => Math.abs(up(upper) - up(lower))));
  }) as Promise<number>;
}

/** The page's own answer and the server's full one of the same poses. */
async function bothAnswers(page: Page): Promise<[number[], number[]]> {
  const own = await page.evaluate(() => Array.from((globalThis as unknown as Hook).tissueform.bench.newest.displacements as Float32Array));
  return [own, await serverAnswer(page)];
}

test("sealed lips stay closed as the command line has them", async () => {
  const { page, faults } = await openFace("lips", true);
  await typeMove(page, "Up", "-3");
  await page.getByText(/Lips up to (?!0\.0)\d\.\d mm apart\.$/).waitFor();
  expect(await edgesApart(page)).toBeGreaterThan(0.5);
  const reloaded = page.waitForEvent("load");
  await page.getByLabel("Contact").selectOption({ label: "Lips sealed, tissue slides" });
  await reloaded;
  await live(page);
  await page.getByText(/A seal holds the edges of the lips, which would be up to \d\.\d mm apart in height, at one height: posture, not mechanics\.$/).waitFor();
  // The lower edge is held where the upper one is while lips are free; then that one moves a little.
  expect(await edgesApart(page)).toBeLessThan(0.1);
  expect(farthest(...(await bothAnswers(page)))).toBeLessThan(MOVING_FILE_MM);
  expect(await page.getByRole("radiogroup", { name: "Model" }).locator("strong").allTextContents()).toEqual(["Linear elastic"]);
  expect(await seriousFindings(page)).toEqual([]);

  await saveExport(planner, page, "Case file", "tissueform-case.tfcase");
  const path = await saveExport(planner, page, "Plan JSON", "tissueform-plan.json");
  const out = join(planner.folder, "sealed.vtu");
  expect(execFileSync(join(BIN, "tissueform"), ["deform", path, "--seal", "--out", out], { encoding: "utf8" })).toMatch(/sealed: [1-9]\d* pairs, released: no/);
  expect(faults).toEqual([]);
  await page.close();
});

test("without contact it is the face in one piece, with the same plan, and back again", async () => {
  const { page, faults } = await openFace("lips", true);
  await typeMove(page, "Up", "0");
  await typeMove(page, "Forward", "-3");
  const parted = await serverAnswer(page);
  const reloaded = page.waitForEvent("load");
  await page.getByLabel("Contact").selectOption({ label: "Tissue sticks, lips are one piece" });
  await reloaded;
  await live(page);
  const whole = await openFace("whole", false);
  await typeMove(whole.page, "Forward", "-3");
  const skins = () => Promise.all([page, whole.page].map(skinAnswer));
  await expect.poll(async () => farthest(...((await skins()) as [number[], number[]]))).toBe(0);
  expect(farthest(parted.slice(0, 9), (await serverAnswer(page)).slice(0, 9))).toBeGreaterThan(0);

  const again = page.waitForEvent("load");
  await page.getByLabel("Contact").selectOption({ label: "Lips part, tissue slides" });
  await again;
  await live(page);
  await expect.poll(async () => farthest(await serverAnswer(page), parted)).toBeLessThan(ROUNDED_MM);
  expect([...faults, ...whole.faults]).toEqual([]);
  await Promise.all([page.close(), whole.page.close()]);
});

/** Of the skin's vertices alone, by the server: the two cases follow other vertices of the bone. */
function skinAnswer(page: Page): Promise<number[]> {
  return page.evaluate(async (model) => {
    const { bench } = (globalThis as unknown as Hook).tissueform;
    const moves: Float32Array = await bench.answers.ofModel(bench.live.session, model, bench.plan.poses());
    return Array.from(bench.file.surfaces[0].follows.places as Uint32Array).flatMap((place) => Array.from(moves.slice(3 * place, 3 * place + 3)));
  }, LINEAR_ELASTIC);
}

test("the plan that is exported gives the command line the same face", async () => {
  const { page } = await openFace("lips", true);
  await typeMove(page, "Forward", "-3");
  await saveExport(planner, page, "Case file", "tissueform-case.tfcase");
  const path = await saveExport(planner, page, "Plan JSON", "tissueform-plan.json");
  const plan = JSON.parse(readFileSync(path, "utf8"));
  expect(plan.version).toBe(4);
  const said = execFileSync(join(BIN, "tissueform"), ["plan", "check", path], { encoding: "utf8" });
  expect(said).toContain("contact");
  await page.close();
});

test("the moving file shows the same face, without a server", async () => {
  const { page, faults } = await openFace("lips", true);
  await typeMove(page, "Forward", "-3");
  await page.waitForFunction(() => (globalThis as unknown as Hook).tissueform.bench.local.heldColumns !== null);
  const path = await saveExport(planner, page, "Moving file", "tissueform-moves.html");
  const planned = await page.evaluate(() => Array.from((globalThis as unknown as Hook).tissueform.view.head.skins[0].shape.positions as Float32Array));
  const file = await context.newPage();
  await file.goto(pathToFileURL(path).href);
  await file.waitForFunction(() => ((globalThis as any).tissueform?.moving?.answered ?? 0) > 0 && (globalThis as any).tissueform.moving.isIdle);
  const shown = await file.evaluate(() => Array.from((globalThis as any).tissueform.moving.view.head.skins[0].shape.positions as Float32Array));
  expect(farthest(planned, shown)).toBeLessThan(MOVING_FILE_MM);
  expect(faults).toEqual([]);
  await Promise.all([page.close(), file.close()]);
});
