// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { execFileSync } from "node:child_process";
import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { dicomSlice } from "../../client/web/tests/volume/dicom_writer";
import { timeInPage } from "./ct_input";
import { HEAD_RECIPE, goToStep, openNewPlan, writeHead } from "./new_plan";
import { type Hook, Planner, live, moved, openCase, openPage, typeMove } from "./planner";

// Figures of docs/planner.md: by hand, on a machine that does nothing else.
//
//   TISSUEFORM_MEASURE_SECONDS=60 TISSUEFORM_CASE=CASE.tfcase TISSUEFORM_CT=FOLDER npm --prefix client/web run measure

const SECONDS = Number(process.env.TISSUEFORM_MEASURE_SECONDS ?? 60);
/** 20 Mbit/s, as the network panel of a browser has it. */
const SLOW = { offline: false, latency: 10, downloadThroughput: 20e6 / 8, uploadThroughput: 20e6 / 8 };

let planner: Planner;
beforeAll(async () => (planner = await Planner.start(process.env.TISSUEFORM_CASE)));
afterAll(() => planner.stop());

test("pose sent to positions and normals in the geometry buffers, memory and pauses of a drag", async () => {
  const { page } = await openCase(await planner.browse(["--js-flags=--expose-gc"]), planner);
  const session = await page.context().newCDPSession(page);
  const heap = async () => {
    await session.send("HeapProfiler.collectGarbage");
    return (await session.send("Runtime.getHeapUsage")).usedSize / 2 ** 20;
  };
  const before = await heap();
  await session.send("Tracing.start", { categories: "v8,disabled-by-default-v8.gc,devtools.timeline" } as never);
  const result = await page.evaluate(drag, SECONDS);
  const pauses = await collectPauses(session as never);
  const after = await heap();
  console.log(JSON.stringify({ ...result, heapBeforeMiB: before, heapAfterMiB: after, longestGcMs: Math.max(0, ...pauses), collections: pauses.length }, null, 1));
}, 1000 * SECONDS + 120_000);

test.each(["gradient_field", "linear_elastic", "neo_hookean"])("pose to positions and normals by the page itself: %s", async (name) => {
  const { page } = await openCase(await planner.browse(), planner);
  const chosen = await page.evaluate(chooseOwnAnswers, name);
  const result = await page.evaluate(drag, SECONDS);
  console.log(JSON.stringify({ model: name, ...chosen, ...result }, null, 1));
}, 1000 * SECONDS + 120_000);

test("an answer, and an answer with the whole interval of each landmark", async () => {
  const { page } = await openCase(await planner.browse(), planner);
  await page.evaluate(chooseOwnAnswers, "linear_elastic");
  console.log(JSON.stringify(await page.evaluate(timeIntervals), null, 1));
}, 120_000);

test("from a target to the bone that gives it, while one pulls", async () => {
  const { page } = await openCase(await planner.browse(), planner);
  await page.evaluate(() => (globalThis as unknown as { tissueform: any }).tissueform.view.stage.setDrawing(false));
  await page.locator("summary").getByText("Soft-tissue targets", { exact: true }).click();
  await page.getByLabel("or a place").selectOption({ label: "Chin" });
  const forward = page.getByRole("textbox", { name: "forward", exact: true });
  const times: number[] = [];
  for (let i = 0; i < 5 * SECONDS; ++i) {
    await forward.fill((3 + (i % 40) / 10).toFixed(1));
    await forward.press("Enter");
    await page.waitForTimeout(i === 0 ? 5000 : 150);
    times.push(await page.evaluate(() => (globalThis as unknown as { tissueform: any }).tissueform.bench.targets.fitted.value.milliseconds));
  }
  const rising = times.slice(1).sort((a, b) => a - b);
  const at = (part: number) => rising[Math.floor(part * (rising.length - 1))];
  console.log(JSON.stringify({ count: rising.length, p50Ms: at(0.5), p95Ms: at(0.95), p99Ms: at(0.99) }, null, 1));
}, 1000 * SECONDS + 120_000);

test.each([["loopback", null], ["20 Mbit/s", SLOW]] as const)("first picture over %s", async (name, network) => {
  const { page } = await openCase(await planner.browse(), planner);
  const session = await page.context().newCDPSession(page);
  await session.send("Network.enable");
  await session.send("Network.setCacheDisabled", { cacheDisabled: true });
  if (network !== null) await session.send("Network.emulateNetworkConditions", network);
  await page.reload();
  await page.waitForFunction(() => ((globalThis as unknown as Hook).tissueform?.view?.stage.drawnCount ?? 0) > 0);
  console.log(name, await page.evaluate(() => `${Math.round(performance.now())} ms to the first picture`));
});

test("from a CT that is dropped to a face that follows", async () => {
  const folder = process.env.TISSUEFORM_CT;
  const recipe = folder === undefined ? HEAD_RECIPE : { format: "tissueform-recipe", version: 7, lips: { part: true }, model: "linear_elastic", segments: HEAD_RECIPE.segments };
  const { page } = await openNewPlan(await planner.browse(), planner.url);
  const begin = performance.now();
  const seconds = () => Math.round(performance.now() - begin) / 1000;
  await page.getByLabel(folder === undefined ? "Choose files" : "Choose a folder").setInputFiles(folder ?? writeHead(planner.folder));
  await page.locator(".plan-views").waitFor({ timeout: 120_000 });
  const readS = seconds();
  await page.evaluate((wanted) => (globalThis as any).tissueform.draft.change(wanted), recipe);
  await goToStep(page, "Build");
  await page.getByRole("button", { name: "Build the plan" }).click();
  const open = page.getByRole("button", { name: "Open the planner" });
  await open.waitFor({ timeout: 240_000 });
  const builtS = seconds();
  const read = page.getByLabel("I have read this");
  if (await open.isDisabled()) {
    await page.getByText(/^\d+ cautions?$/).click();
    await read.check();
  }
  await open.click();
  await live(page);
  await typeMove(page, "Forward", "8");
  await moved(page, 3, 12);
  console.log(JSON.stringify({ ct: folder === undefined ? "bundled head" : "TISSUEFORM_CT", readS, builtS, followsS: seconds() }));
}, 400_000);

test("a cut that is dragged, from its move to the colored pieces", async () => {
  const ct = process.env.TISSUEFORM_CT;
  if (ct === undefined) return console.log("set TISSUEFORM_CT to a folder with a CT series to measure its preview");
  const { page } = await openPage(await planner.browse(), `${planner.url}/#new`);
  await page.getByLabel("Choose a folder").setInputFiles(ct);
  await page.locator(".plan-views").waitFor();
  await page.getByRole("button", { name: "4. Operation" }).click();
  await page.getByRole("button", { name: "Add", exact: true }).click();
  await page.getByRole("button", { name: "Set planes" }).click();
  await page.getByText(/mandible \d+\.\d cm³/).waitFor();
  const times = (await page.evaluate(dragCut, SECONDS)).sort((a, b) => a - b);
  console.log(JSON.stringify({ answers: times.length, p50Ms: times[times.length >> 1], p95Ms: times[Math.floor(0.95 * times.length)] }));
}, 1000 * SECONDS + 120_000);

/** Runs in the page: from each move of a plane to its answer, in ms, each with all that is drawn on the way. */
async function dragCut(seconds: number): Promise<number[]> {
  const { draft } = (globalThis as unknown as { tissueform: { draft: any } }).tissueform;
  const pieces = document.querySelector(".pieces") as HTMLElement;
  const { id, plane } = draft.planes[0];
  const times: number[] = [];
  const end = performance.now() + 1000 * seconds;
  for (let step = 0; performance.now() < end; ++step) {
    const begin = performance.now();
    const answered = new Promise<void>((done) => new MutationObserver((_, observer) => (observer.disconnect(), done())).observe(pieces, { childList: true }));
    const [x, y, z] = plane.point_mm;
    draft.movePlane(id, { ...plane, point_mm: [x, y + 10 * Math.sin(step / 10), z] }, false);
    await answered;
    await new Promise((drawn) => requestAnimationFrame(drawn));
    times.push(Math.round(performance.now() - begin));
  }
  return times;
}

/** Runs in the page: until it answers for this model by itself. */
async function chooseOwnAnswers(name: string) {
  const { bench } = (globalThis as unknown as { tissueform: { bench: any } }).tissueform;
  const { model } = bench.models.find((info: any) => info.name === name);
  await bench.chooseModel(model);
  const isReady = () => bench.localState.value.kind === "ready" && bench.local.configuration.model === model;
  while (!isReady()) await new Promise((done) => setTimeout(done, 20));
  const { place } = bench.localState.value;
  return { place, columnBytes: bench.local.columns.bytes.length, handles: bench.plan.handles.length, vertices: bench.file.followed.length };
}

/** Runs in the page: a drag at 60 poses a second with drawing off; times are of the page. */
async function drag(seconds: number) {
  const { bench, view } = (globalThis as unknown as { tissueform: { bench: any; view: any } }).tissueform;
  view.stage.setDrawing(false);
  // Of pictures of the page's own, and of those that only the server could answer.
  const [times, late]: number[][] = [[], []];
  const shape = view.head.skins[0].shape;
  const { lay } = Object.getPrototypeOf(bench);
  let sentAt = 0;
  // After the picture was laid positions and normals are in the buffers.
  bench.lay = function (...words: unknown[]) {
    lay.apply(this, words);
    const isOwn = bench.localState.value.kind !== "ready" || bench.localState.value.coverage === "covered";
    if (sentAt > 0) (isOwn ? times : late).push(performance.now() - sentAt);
    sentAt = 0;
  };
  const end = performance.now() + 1000 * seconds;
  let step = 0;
  let longestGapMs = 0;
  let last = performance.now();
  while (performance.now() < end) {
    await new Promise((done) => setTimeout(done, 16));
    const now = performance.now();
    longestGapMs = Math.max(longestGapMs, now - last);
    last = now;
    if (sentAt === 0) sentAt = now;
    bench.plan.change(bench.plan.handles.length > 1 ? 1 : 0, { forwardMm: 4 * Math.sin(step++ / 40), pitchDeg: 3 * Math.sin(step / 70) }, false);
  }
  delete bench.lay;
  view.stage.setDrawing(true);
  times.sort((a, b) => a - b);
  const at = (share: number) => Math.round(100 * times[Math.floor(share * (times.length - 1))]) / 100;
  return { pictures: times.length, beyond: late.length, p50Ms: at(0.5), p99Ms: at(0.99), maxMs: at(1), longestGapMs, movingVertices: shape.movingCount, skinVertices: shape.positions.length / 3 };
}

interface Tracing {
  send(method: "Tracing.end"): Promise<void>;
  on(event: "Tracing.dataCollected", listener: (data: { value: { name: string; ph: string; dur?: number }[] }) => void): void;
  once(event: "Tracing.tracingComplete", listener: () => void): void;
}

/** Milliseconds of each garbage collection of the main thread. */
async function collectPauses(session: Tracing): Promise<number[]> {
  const pauses: number[] = [];
  session.on("Tracing.dataCollected", ({ value }) => {
    for (const { name, ph, dur } of value) {
      if (ph === "X" && (name === "MinorGC" || name === "MajorGC")) pauses.push((dur ?? 0) / 1000);
    }
  });
  const complete = new Promise<void>((done) => session.once("Tracing.tracingComplete", done));
  await session.send("Tracing.end");
  await complete;
  return pauses;
}

/** Soft tissue in air with a scanner's noise of 20 HU: what a codec can make smaller. `option`: of gdcmconv. */
function scannedSlice(option: string): string {
  const noise = () => 20 * Math.sqrt(-2 * Math.log(1 - Math.random())) * Math.cos(2 * Math.PI * Math.random());
  const values = Int16Array.from({ length: 512 * 512 }, (_, i) => Math.round((Math.hypot((i % 512) - 256, Math.floor(i / 512) - 256) < 180 ? 40 : -1000) + noise()));
  const [plain, packed] = ["plain", "packed"].map((name) => join(planner.folder, name));
  writeFileSync(plain, dicomSlice(0, { rows: 512, columns: 512, values, texts: { "00200032": ["DS", "-10\\-20\\0000.0"] } }));
  execFileSync("gdcmconv", [option, plain, packed]);
  return readFileSync(packed).toString("base64");
}

test("a CT of 600 slices of 512 x 512 is read, compressed ones too, and one of 400 by the memory of the page's process", async () => {
  for (const [count, option] of [[600, "--raw"], [600, "--jpeg"], [600, "--jpegls"], [600, "--j2k"], [400, "--raw"], [400, "--j2k"]] as const) {
    const base64 = scannedSlice(option);
    const { page } = await openPage(await planner.browse(), planner.url);
    let mostMiB = 0;
    const sampling = setInterval(() => (mostMiB = Math.max(mostMiB, rendererMiB())), 200);
    const result = await page.evaluate(timeInPage, { base64, count });
    clearInterval(sampling);
    console.log(JSON.stringify({ option, ...result, rendererMiB: mostMiB }, null, 1));
    await page.context().close();
  }
}, 300_000);

/** Resident memory of the largest process that draws and computes a page. */
function rendererMiB(): number {
  const lines = execFileSync("ps", ["-eo", "rss,args"], { encoding: "utf8", maxBuffer: 2 ** 24 }).split("\n").filter((line) => line.includes("--type=renderer"));
  return Math.max(0, ...lines.map((line) => Number(line.trim().split(/\s+/)[0]) / 1024));
}

/** What the interval asks is taken from the page; a segment has to be moved first. */
async function timeIntervals() {
  const { bench } = (globalThis as unknown as { tissueform: any }).tissueform;
  const { host } = bench.local;
  let asked: { sets: unknown[][]; vertices: Int32Array } | null = null;
  const own = host.placesAt.bind(host);
  host.placesAt = (sets: unknown[][], vertices: Int32Array) => own(...((asked = { sets, vertices }), [sets, vertices]));
  bench.plan.change(0, { forwardMm: -6 }, true);
  while (asked === null) await new Promise((done) => setTimeout(done, 100));
  const { sets, vertices } = asked as { sets: unknown[][]; vertices: Int32Array };
  const median = (run: () => void) => {
    const times = Array.from({ length: 200 }, () => {
      const start = performance.now();
      for (let i = 0; i < 10; ++i) run();
      return (performance.now() - start) / 10;
    });
    return times.sort((a, b) => a - b)[100];
  };
  const answer = () => host.evaluator.evaluate(sets[0]);
  const [answerMs, bothMs] = [median(answer), median(() => (answer(), host.evaluator.placesAt(sets, vertices)))];
  return { poseSets: sets.length, vertices: vertices.length, answerMs, bothMs, ratio: bothMs / answerMs };
}
