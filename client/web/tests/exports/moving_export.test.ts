// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { afterEach, beforeAll, expect, test, vi } from "vitest";
import { openCase } from "../../src/case/case_file";
import { evaluatorModule } from "../../src/evaluation/evaluator_module";
import { movingDataOf, movingFile } from "../../src/exports/moving_export";
import type { BoundPhotograph } from "../../src/movingdata/photograph_data";
import { readMovingData, writeMovingData } from "../../src/movingdata/moving_data";
import { goldenBytes, goldenCases } from "../evaluation/golden_answers";
import { smallCase, sourceOf } from "../testing/small_case";

const answers = new Uint8Array([1, 2, 3]);
const file = () => openCase(sourceOf(smallCase()));
const plan = { poses: new Map(), model: "linear_elastic", answers, photograph: null };

// It is fetched once per page, and some tests here allow no fetch.
beforeAll(() => evaluatorModule());

afterEach(() => vi.unstubAllGlobals());

test("what is exported is the case's surfaces, the plan's poses and nothing that names anybody", async () => {
  const pose = { rotationVector: [0, 0, Math.PI / 6] as [number, number, number], pivotMm: [1, 2, 3] as [number, number, number], translationMm: [0, -4, 0] as [number, number, number], scale: 1 };
  const opened = await file();
  const data = movingDataOf(opened, { ...plan, poses: new Map([["mandible", pose]]) });
  expect(data.handles.map(({ name, isFree }) => [name, isFree])).toEqual([["mandible", true]]);
  expect(data.handles[0].pose.rotationVectorDeg[2]).toBeCloseTo(30, 9);
  expect(data.handles[0].pose.translationMm).toEqual([0, -4, 0]);
  const back = readMovingData(writeMovingData(data));
  expect(back.surfaces.map(({ name }) => name)).toEqual(["skin", "mandible", "skull"]);
  expect(back.surfaces[0].positions).toEqual(opened.surfaces[0].positions);
  expect(Array.from(back.answers)).toEqual([1, 2, 3]);
  const text = new TextDecoder().decode(writeMovingData(data));
  for (const secret of ["meshes/", "small", "2026-01-01", "plan_sha256", "pogonion"]) expect(text).not.toContain(secret);
});

test("a photograph is in the file only where it is wanted, and comes back", async () => {
  const photograph: BoundPhotograph = {
    positions: new Float32Array([0, 0, 0, 10, 0, 0, 0, 10, 0.5]),
    drawn: new Uint32Array([0, 1, 2, 0]),
    triangles: new Uint32Array([3, 1, 2]),
    uv: new Float32Array([0, 0, 1, 0, 0, 1, 1, 1]),
    colors: null,
    image: new Uint8Array([0xff, 0xd8, 0xff, 4]),
    places: new Uint32Array([0, 1, 2, 1, 2, 3, 0, 0, 0]),
    weights: new Float32Array([1, 0, 0, 0, 1, 0, 0, 0, 0]),
    offsetsMm: new Float32Array([0.5, -1.25, 0]),
  };
  const opened = await file();
  expect(readMovingData(writeMovingData(movingDataOf(opened, plan))).photograph).toBeNull();
  const bytes = writeMovingData(movingDataOf(opened, { ...plan, photograph }));
  expect(readMovingData(bytes).photograph).toEqual(photograph);
  const colored = { ...photograph, uv: null, image: null, colors: new Uint8Array([1, 2, 3, 4, 5, 6, 7, 8, 9, 250, 251, 252]) };
  expect(readMovingData(writeMovingData(movingDataOf(opened, { ...plan, photograph: colored }))).photograph).toEqual(colored);
});

test("a short password is refused before anything is fetched", async () => {
  const fetched = vi.fn();
  vi.stubGlobal("fetch", fetched);
  await expect(movingFile(await file(), plan, "short")).rejects.toThrow("at least 8 letters");
  expect(fetched).not.toHaveBeenCalled();
});

const CASES = goldenCases("neo_hookean_third_order");
const neoHookean = (number: number) => ({
  poses: new Map([["mandible", CASES[number].poses[0]]]),
  model: "neo_hookean",
  answers: goldenBytes("neo_hookean_third_order").slice(),
  photograph: null,
});

test("a gateway without the page is said to have none", async () => {
  vi.stubGlobal("document", { baseURI: "http://127.0.0.1/" });
  vi.stubGlobal("fetch", async () => new Response("", { status: 404 }));
  await expect(movingFile(await file(), neoHookean(1), "")).rejects.toThrow("moving-file.html");
});

test("a plan that the answers do not reach is refused in a sentence that names another model", async () => {
  const fetched = vi.fn();
  vi.stubGlobal("fetch", fetched);
  expect([CASES[1].isCovered, CASES[7].isCovered]).toEqual([true, false]);
  await expect(movingFile(await file(), neoHookean(7), "")).rejects.toThrow(/could not show it: choose Linear elastic/);
  await expect(movingFile(await file(), { ...neoHookean(7), model: "linear_elastic" }, "")).rejects.toThrow("choose Gradient field");
  expect(fetched).not.toHaveBeenCalled();
});
