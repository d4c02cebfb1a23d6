// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { writeFileSync } from "node:fs";
import { join } from "node:path";
import type { BrowserContext, Page } from "playwright-core";
import { AnswerEvaluator } from "../../client/web/src/evaluation/answer_evaluator";
import { evaluatorModule } from "../../client/web/src/evaluation/evaluator_module";
import type { Pose } from "../../client/web/src/geometry/pose";
import { fromBase64 } from "../../client/web/src/movingdata/sealed_payload";
import { handMadeCase } from "../../client/web/tests/testing/hand_made_case";
import { Planner, type Hook, live, moved, openCase, openPage, takeSegment, typeMove } from "./planner";
import { SlowLine } from "./slow_line";

// The page's own answers, on a line on which the server's come late.

/** Each way. */
const DELAY_MS = 150;
const FRAMES = 40;

let planner: Planner;
let line: SlowLine;
beforeAll(async () => {
  planner = await Planner.start();
  line = await SlowLine.open(planner.url, DELAY_MS);
});
afterAll(async () => {
  line.close();
  await planner.stop();
});

async function openSlowly(context: BrowserContext): Promise<{ page: Page; faults: string[] }> {
  const opened = await openPage(context, line.url);
  await opened.page.setInputFiles("input[type=file]", planner.casePath);
  await live(opened.page);
  return opened;
}

interface Ready {
  place: string;
}

/** Until the page answers by itself. */
async function ready(page: Page, model?: number): Promise<Ready> {
  await page.waitForFunction((wanted) => {
    const { bench } = (globalThis as unknown as Hook).tissueform;
    return bench.localState.value.kind === "ready" && (wanted === undefined || bench.local.configuration.model === wanted);
  }, model);
  return page.evaluate(() => (globalThis as unknown as Hook).tissueform.bench.localState.value);
}

const MOST_TRIES = 5;

/** The same, and in the page itself: if the machine was too busy when it was measured a worker has the work, and it is measured again. */
async function readyInPage(page: Page, model?: number): Promise<Ready> {
  for (let tries = 1; ; ++tries) {
    const state = await ready(page, model);
    if (state.place === "page" || tries === MOST_TRIES) return state;
    await page.getByRole("button", { name: "Stop", exact: true }).click();
    await page.getByRole("button", { name: "Answer here" }).click();
  }
}

function modelOf(page: Page, name: string): Promise<number> {
  return page.evaluate((wanted) => (globalThis as unknown as Hook).tissueform.bench.models.find((info: any) => info.name === wanted).model, name);
}

interface DragFrame {
  /** Of the face's largest movement, right after the hand's move. */
  largestMm: number;
  /** Later, before the next move. */
  laterMm: number;
}

/** One move of the lower jaw forward in each animation frame. */
function dragForward(page: Page, frames: number): Promise<{ frames: DragFrame[]; roundTripMs: number }> {
  return page.evaluate(async (count) => {
    const { bench, view } = (globalThis as unknown as Hook).tissueform;
    const { shape } = view.head.skins[0];
    const largest = () => {
      let most = 0;
      for (let i = 0; i < shape.positions.length; i += 3) {
        most = Math.max(most, Math.hypot(...[0, 1, 2].map((k) => shape.positions[i + k] - shape.rest[i + k])));
      }
      return most;
    };
    view.stage.setDrawing(false);
    const seen = [];
    for (let step = 1; step <= count; ++step) {
      await new Promise((done) => requestAnimationFrame(done));
      bench.plan.change(1, { forwardMm: (5 * step) / count }, step === count);
      const largestMm = largest();
      await new Promise((done) => setTimeout(done, 12));
      seen.push({ largestMm, laterMm: largest() });
    }
    view.stage.setDrawing(true);
    return { frames: seen, roundTripMs: bench.picture.value.roundTripMs };
  }, frames);
}

/** Until the page itself has answered the newest poses, those of a drag. */
async function followedByPage(page: Page): Promise<void> {
  await page.waitForFunction(() => (globalThis as unknown as Hook).tissueform.bench.local.posesSinceShown === 0);
  await moved(page, 3, 9);
}

const MODELS = [["gradient_field", "Gradient field"], ["linear_elastic", "Linear elastic"], ["neo_hookean", "Neo-Hookean"]] as const;

describe("on a line with delay", () => {
  let opened: Awaited<ReturnType<typeof openSlowly>>;
  beforeAll(async () => (opened = await openSlowly(await planner.browse())));
  afterEach(() => expect(opened.faults).toEqual([]));

  test.each(MODELS)("%s: the face follows the hand in the same animation frame, and never goes back", async (name, label) => {
    const { page } = opened;
    await takeSegment(page, "Lower jaw");
    await page.getByRole("radio", { name: new RegExp(`^${label}`) }).check();
    await typeMove(page, "Forward", "0");
    expect(await readyInPage(page, await modelOf(page, name))).toMatchObject({ place: "page" });
    const { frames, roundTripMs } = await dragForward(page, FRAMES);
    expect(roundTripMs).toBeGreaterThan(2 * DELAY_MS);
    let before = 0;
    for (const { largestMm, laterMm } of frames) {
      expect(largestMm).toBeGreaterThan(before + 0.03);
      expect(laterMm).toBeGreaterThan(largestMm - 0.05);
      before = largestMm;
    }
    expect(before).toBeGreaterThan(3);
  });

  test("the server's answer to the newest poses confirms the page's", async () => {
    const { page } = opened;
    await page.getByRole("radio", { name: /^Linear elastic/ }).check();
    await ready(page, await modelOf(page, "linear_elastic"));
    const [own, confirmed] = await page.evaluate(async () => {
      const { bench } = (globalThis as unknown as Hook).tissueform;
      // Both are taken as they come, whichever comes first.
      const once = (owner: any, name: string, wanted: (answer: any) => boolean) =>
        new Promise<number[]>((done) => {
          const original = owner[name];
          owner[name] = (...words: unknown[]) => {
            original(...words);
            if (wanted(words[0])) done(Array.from(bench.newest.displacements as Float32Array));
          };
        });
      const sent = () => bench.local.posesSinceShown === 0;
      const mine = once(bench.local.listener, "onEvaluation", sent);
      bench.plan.change(1, { forwardMm: 5, pitchDeg: 2 }, true);
      const theirs = once(bench.live.listener, "onPicture", (picture) => picture.posesBehind === 0 && picture.frame.refinement === 0);
      return Promise.all([mine, theirs]);
    });
    const off = own.reduce((most, value, i) => Math.max(most, Math.abs(value - confirmed[i])), 0);
    expect(off).toBeLessThan(0.02);
  });

  test("beyond what was prepared the server answers, and the page says so", async () => {
    const { page } = opened;
    await page.getByRole("radio", { name: /^Neo-Hookean/ }).check();
    await ready(page, await modelOf(page, "neo_hookean"));
    await typeMove(page, "Forward", "12");
    await page.getByText("Outside the prepared range: the server answers.").waitFor();
    await page.waitForFunction(() => (globalThis as unknown as Hook).tissueform.bench.picture.value.summary?.prepared === false);
    await typeMove(page, "Forward", "1");
    await page.getByText("This page answers at once; the server confirms.").waitFor();
  });

  test("a line that broke off takes nothing from the hand", async () => {
    const { page } = opened;
    // Written down: a page that is slow to ask finds it live again.
    await page.evaluate(() => {
      const { bench } = (globalThis as unknown as Hook).tissueform;
      (globalThis as any).broken = new Promise<void>((done) => bench.connection.watch(({ kind }: { kind: string }) => kind !== "live" && done()));
    });
    line.breakOff();
    await page.evaluate(() => (globalThis as any).broken);
    await page.evaluate(() => (globalThis as unknown as Hook).tissueform.bench.plan.change(1, { forwardMm: 0, pitchDeg: 0 }, true));
    await dragForward(page, 5);
    await followedByPage(page);
    await live(page);
    await ready(page);
  });

  test("after a stop the server answers, and local answers can start again", async () => {
    const { page } = opened;
    await page.getByRole("button", { name: "Stop", exact: true }).click();
    await page.evaluate(() => (globalThis as unknown as Hook).tissueform.bench.plan.change(1, { forwardMm: 1 }, true));
    expect(await page.evaluate(() => (globalThis as unknown as Hook).tissueform.bench.localState.value.kind)).toBe("stopped");
    await page.getByRole("button", { name: "Answer here" }).click();
    await ready(page);
  });
});

async function browseWithout(name: string): Promise<BrowserContext> {
  const context = await planner.browse();
  await context.addInitScript((missing) => {
    delete (globalThis as unknown as Record<string, unknown>)[missing];
  }, name);
  return context;
}

test("a browser without a background thread answers, too", async () => {
  const { page, faults } = await openCase(await browseWithout("Worker"), planner);
  expect(await readyInPage(page)).toMatchObject({ place: "page" });
  await page.getByText("This page answers at once (without a background thread: slower); the server confirms.").waitFor();
  await dragForward(page, 10);
  await followedByPage(page);
  expect(faults).toEqual([]);
});

test("without WebAssembly the server answers, and the page says why", async () => {
  const { page, faults } = await openCase(await browseWithout("WebAssembly"), planner);
  await page.getByText("The server answers. This page cannot: this browser has no WebAssembly, or it is switched off").waitFor();
  await takeSegment(page, "Lower jaw");
  await typeMove(page, "Forward", "8");
  await moved(page, 6, 12);
  expect(faults).toEqual([]);
});

const POSES = 1000;
/** Of each answer the page itself compares every vertex; out of it come every so manieth, others of each pose. */
const STRIDE = 20;

/** An answer of the server to a pose of the hand. */
interface ServerAnswer {
  poses: Pose[];
  isPrepared: boolean;
  errorMm: number;
  /** How far the page's own answer is off at most: null where it has none. */
  pageOffMm: number | null;
  first: number;
  /** As base64 of floats, of the vertices first, first + STRIDE, ... */
  positions: string;
  bandMm: string;
}

/** Runs in the page: random poses of all segments, up to 5 mm and 4.6 degrees times `size` along each axis, each asked of the server once the one before was answered, and of the page. */
async function askBoth([count, stride, size]: readonly [number, number, number]): Promise<{ columns: string; answers: ServerAnswer[] }> {
  const { bench } = (globalThis as unknown as Hook).tissueform;
  const base64 = (bytes: Uint8Array) => {
    const parts = [];
    for (let at = 0; at < bytes.length; at += 8190) parts.push(btoa(String.fromCharCode(...bytes.subarray(at, at + 8190))));
    return parts.join("");
  };
  const picked = (values: Float32Array, width: number, first: number) => {
    const rows = [];
    for (let at = first * width; at < values.length; at += stride * width) rows.push(...values.subarray(at, at + width));
    return base64(new Uint8Array(Float32Array.from(rows).buffer));
  };
  let seed = 7;
  const random = (most: number) => most * (2 * (seed = (seed * 48271) % 2147483647) / 2147483647 - 1);
  const vector = (most: number) => [random(most), random(most), random(most)];
  const show = bench.live.listener.onPicture;
  const { evaluator } = bench.local.host;
  const pageOffMm = (poses: Pose[], positions: Float32Array) => {
    const own = evaluator.evaluate(poses);
    if (own.coverage !== "covered") return null;
    return positions.reduce((most, value, i) => Math.max(most, Math.abs(value - own.positions[i])), 0);
  };
  const answers = [];
  for (let i = 0; i < count; ++i) {
    const poses = bench.plan.handles.map((_: unknown, handle: number) => {
      const pivotMm = bench.plan.pivot(handle).map((value: number) => value + random(5));
      return { rotationVector: vector(0.08 * size), pivotMm, translationMm: vector(5 * size), scale: 1 };
    });
    const picture = await new Promise<any>((done) => {
      bench.live.listener.onPicture = (answer: any, used: () => void) => {
        used();
        if (answer.posesBehind === 0 && answer.frame.refinement === 0) done(answer);
      };
      bench.live.sendPoses(poses, false);
    });
    const { prepared, errorBoundMm } = picture.frame.summary;
    const bandMm = picture.uncertainty === null ? "" : picked(picture.uncertainty, 1, i % stride);
    answers.push({ poses, isPrepared: prepared, errorMm: errorBoundMm, pageOffMm: pageOffMm(poses, picture.positions), first: i % stride, positions: picked(picture.positions, 3, i % stride), bandMm });
  }
  bench.live.listener.onPicture = show;
  return { columns: base64(bench.local.heldColumns), answers };
}

const floats = (text: string) => new Float32Array(fromBase64(text).slice().buffer);

/** The poses of askBoth by this model: page and Node give what the server gives, the band as well. */
async function compareAnswers(page: Page, name: string, label: string, size: number): Promise<void> {
  await page.getByRole("radio", { name: new RegExp(`^${label}`) }).check();
  expect(await readyInPage(page, await modelOf(page, name))).toMatchObject({ place: "page" });
  const { columns, answers } = await page.evaluate(askBoth, [POSES, STRIDE, size] as const);
  const bytes = fromBase64(columns);
  const evaluator = await AnswerEvaluator.open(bytes, await evaluatorModule());
  let [compared, mostMm, mostBandMm] = [0, 0, 0];
  for (const { poses, isPrepared, errorMm, pageOffMm, first, positions, bandMm } of answers) {
    expect(pageOffMm !== null).toBe(isPrepared);
    expect(pageOffMm ?? 0).toBeLessThan(1e-4 + errorMm);
    mostMm = Math.max(mostMm, pageOffMm ?? 0);
    const own = evaluator.evaluate(poses);
    expect(own.coverage === "covered").toBe(isPrepared);
    if (!isPrepared) continue;
    compared += 1;
    const off = largestOff(floats(positions), own.positions, 3, first);
    expect(off).toBeLessThan(1e-4 + errorMm);
    mostMm = Math.max(mostMm, off);
    expect(own.uncertainty === null).toBe(bandMm === "");
    if (own.uncertainty === null) continue;
    mostBandMm = Math.max(mostBandMm, largestOff(floats(bandMm), own.uncertainty, 1, first));
  }
  console.log(`${name}: ${compared} of ${POSES} poses; positions at most ${mostMm.toExponential(1)} mm off, the band ${mostBandMm.toFixed(3)}`);
  expect(compared).toBeGreaterThan(POSES / 2);
  expect(mostBandMm).toBeLessThan(0.025);
}

describe("a thousand random poses", () => {
  let page: Page;
  beforeAll(async () => ({ page } = await openCase(await planner.browse(), planner)));

  test.each(MODELS)("%s: page and Node give what the server gives, the band as well", (name, label) => compareAnswers(page, name, label, name === "neo_hookean" ? 0.25 : 1));

  test("linear_elastic where lips part: the same", async () => {
    const path = join(planner.folder, "lips.tfcase");
    writeFileSync(path, handMadeCase(true));
    const lips = await openCase(await planner.browse(), planner, path);
    await compareAnswers(lips.page, "linear_elastic", "Linear elastic", 1);
    expect(lips.faults).toEqual([]);
  });
});

/** Of every STRIDEth row of `all` from `first` on, and `picked`, which has these. */
function largestOff(picked: Float32Array, all: Float32Array, width: number, first: number): number {
  let most = 0;
  picked.forEach((value, i) => {
    const row = first + STRIDE * Math.floor(i / width);
    most = Math.max(most, Math.abs(value - all[width * row + (i % width)]));
  });
  return most;
}
