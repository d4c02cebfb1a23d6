// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { faceThatFollows } from "../testing/following_face";

/** As the gateway gives it: nothing is left out. */
const entry = (source: string, chinMm: number) => ({
  source,
  surgery: { translation_mm: [1, 2, 3], rotation_deg: [0, 0, 0] },
  model_mm: { default: 1, chin: chinMm, lower_lip: 1.5, upper_lip: 1.5 },
});
const TABLE = { ...entry("our clinic, 40 patients", 2), operations: { bsso: entry("our clinic, bsso", 4) } };

/** A page of a gateway that answers so. */
async function pageOf(reply: () => Response) {
  vi.resetModules();
  vi.stubGlobal("location", { protocol: "https:", href: "https://gateway.example/planner/#x" });
  const asked = vi.fn((url: string) => (expect(url).toBe("https://gateway.example/planner/config.json"), Promise.resolve(reply())));
  vi.stubGlobal("fetch", asked);
  const deviations = await import("../../src/measures/deviations");
  const { movementBands } = await import("../../src/measures/movement_bands");
  return { ...deviations, movementBands, asked };
}

beforeEach(() => vi.resetModules());
afterEach(() => vi.unstubAllGlobals());

test("a clinic's figures, and those of an operation, are in the intervals", async () => {
  const { deviationsInUse, chosen, modelDeviation, movementBands, asked } = await pageOf(() => Response.json({ deviations: TABLE }));
  expect(await deviationsInUse()).toMatchObject({ source: "our clinic, 40 patients", translationMm: [1, 2, 3] });
  const { shown, answers } = await faceThatFollows(0.7, null);
  const skin = shown.file.manifest.landmarks.findIndex(({ name }) => name === "soft_pogonion");
  const modelOf = async () => (await movementBands(shown, answers))?.[skin]?.totalMm.parts;
  const [all, own] = [await modelOf(), ((chosen.operation = "bsso"), await modelOf())];
  expect(all?.source).toBe("our clinic, 40 patients");
  expect(own?.source).toBe("our clinic, bsso");
  expect((own?.model ?? NaN) / (all?.model ?? NaN)).toBeCloseTo(2, 6);
  expect(own?.surgery).toBe(all?.surgery);
  expect(modelDeviation(await deviationsInUse(), "soft_menton")).toBe(4);
  expect(modelDeviation(await deviationsInUse(), "soft_glabella")).toBe(1);
  chosen.operation = "another";
  expect((await deviationsInUse()).source).toBe("our clinic, 40 patients");
  expect(asked).toHaveBeenCalledTimes(1);
});

test.each([
  ["a gateway without figures", () => Response.json({})],
  ["a server of files alone", () => new Response("", { status: 404 })],
])("%s: published", async (_, reply) => {
  const { deviationTable, PUBLISHED } = await pageOf(reply);
  expect(await deviationTable()).toBe(PUBLISHED);
});

test.each([
  ["a list", []],
  ["another number of axes", { ...TABLE, surgery: { translation_mm: [1], rotation_deg: [0, 0, 0] } }],
  ["a negative number", { ...TABLE, model_mm: { default: -1 } }],
  ["no default", { ...TABLE, model_mm: { chin: 1 } }],
  ["an operation that is no object", { ...TABLE, operations: { bsso: 1 } }],
])("%s is refused, never taken for published", async (_, deviations) => {
  const { deviationTable } = await pageOf(() => Response.json({ deviations }));
  await expect(deviationTable()).rejects.toThrow("the gateway's deviations cannot be read");
});

test("a gateway that was away is asked again", async () => {
  let isAway = true;
  const { deviationTable, PUBLISHED } = await pageOf(() => (isAway ? new Response("", { status: 503 }) : Response.json({})));
  await expect(deviationTable()).rejects.toThrow();
  isAway = false;
  expect(await deviationTable()).toBe(PUBLISHED);
});
