// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { readFileSync, readdirSync } from "node:fs";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { describe, expect, test } from "vitest";
import { EMPTY_RECIPE, type Recipe, parseDraft, parseRecipe, recipeText, rounded, withSegment, withSegments, withValue } from "../../src/building/recipe";
import { PlanDraft } from "../../src/building/plan_draft";
import { leastVersion, schemaProblem } from "../../src/building/recipe_schema";

const ROOT = fileURLToPath(new URL("../../../..", import.meta.url));
const PLANS = join(ROOT, "tests/data/plans");
const bundled = readdirSync(PLANS).map((name) => join(PLANS, name, "recipe.json")).filter((path) => readdirSync(join(path, "..")).includes("recipe.json"));
const documented = Array.from(readFileSync(join(ROOT, "docs/recipe-format.md"), "utf8").matchAll(/```json\n(\{[\s\S]*?)\n```/g), (match) => match[1]);

const MOVED: Recipe = { ...EMPTY_RECIPE, segments: [{ name: "mandible", osteotomy: "bssro", pose: { translation_mm: [0, -6, 0] } }] };

test("there are recipes to try", () => {
  expect(bundled.length).toBeGreaterThan(3);
  expect(documented.length).toBeGreaterThan(1);
});

test.each([...bundled.map((path) => readFileSync(path, "utf8")), ...documented])("a recipe comes back as it was: %.40s", (text) => {
  const recipe = parseRecipe(text);
  expect(recipe).toEqual(JSON.parse(text));
  expect(parseRecipe(recipeText(recipe))).toEqual(recipe);
  expect(leastVersion(recipe)).toBeLessThanOrEqual(recipe.version);
});

describe("a recipe that cannot be used is refused with its place", () => {
  const cases: [string, (recipe: any) => void, string][] = [
    ["a key that is unknown", (recipe) => (recipe.sements = []), 'the key "sements" is unknown'],
    ["a key of every object's prototype", (recipe) => (recipe.constructor = 1), 'the key "constructor" is unknown'],
    ["no segments", (recipe) => (recipe.segments = []), "segments needs at least 1 entries"],
    ["a segment without a name", (recipe) => delete recipe.segments[0].name, 'segments[0] has no "name"'],
    ["an osteotomy that is unknown", (recipe) => (recipe.segments[0].osteotomy = "lefort"), 'segments[0].osteotomy must be one of "bssro", "le_fort_1", "genioplasty"'],
    ["a vector of two numbers", (recipe) => (recipe.segments[0].pose.translation_mm = [1, 2]), "segments[0].pose.translation_mm needs at least 3 entries"],
    ["a number out of range", (recipe) => (recipe.spacing_mm = 9), "spacing_mm must be at most 4"],
    ["a text in place of a number", (recipe) => (recipe.spacing_mm = "2"), "spacing_mm must be a number"],
    ["axes of other letters", (recipe) => (recipe.ct = { axes: "XYZ" }), "ct.axes must match ^[LRAPSI]{3}$"],
    ["a whole number that is none", (recipe) => (recipe.ct = { series_number: 1.5 }), "ct.series_number must be a whole number"],
    ["Poisson's ratio of a fluid", (recipe) => (recipe.poisson_ratio = 0.5), "poisson_ratio must be less than 0.5"],
    ["metal that is neither word nor number", (recipe) => (recipe.metal = 100), "metal must be at least 2500"],
  ];
  test.each(cases)("%s", (_, change, problem) => {
    const recipe = structuredClone(MOVED);
    change(recipe);
    expect(schemaProblem(recipe)).toBe(problem);
  });

  test("text that is not JSON", () => {
    expect(() => parseRecipe("{")).toThrow(/^the recipe is not JSON: /);
  });
});

describe("a recipe that has no segments yet", () => {
  const bare = { format: "tissueform-recipe", version: 6, ct: { hu_offset: -1024 }, landmarks: { points_mm: { pogonion: [1, 2, 3] } }, occlusal_plane: { point_mm: [0, 0, 0], normal: [0, 0, 1] }, spacing_mm: 2 };

  test.each([[[]], [undefined]])("comes back with all its other keys: %j", (segments) => {
    const draft = parseDraft(JSON.stringify({ ...bare, segments }));
    expect(draft).toEqual({ ...bare, segments: [] });
    expect(parseDraft(recipeText(draft))).toEqual(draft);
    expect(() => parseRecipe(recipeText(draft))).toThrow("segments needs at least 1 entries");
  });

  test.each<[object, string]>([
    [{ ...bare, sements: [] }, 'the key "sements" is unknown'],
    [{ ...bare, segments: {} }, "segments must be a list"],
    [{ ...bare, segments: [{}] }, 'segments[0] has no "name"'],
    [{ ...bare, spacing_mm: 9 }, "spacing_mm must be at most 4"],
    [[], "the recipe must be an object"],
  ])("is refused for what else is wrong: %j", (json, problem) => {
    expect(() => parseDraft(JSON.stringify(json))).toThrow(problem);
  });

  test("stays in the tab through a reload, and is drawn from there", () => {
    const kept = new Map<string, string>();
    const storage = { getItem: (key: string) => kept.get(key) ?? null, setItem: (key: string, value: string) => void kept.set(key, value) };
    new PlanDraft(storage).change(parseDraft(JSON.stringify(bare)));
    const again = new PlanDraft(storage);
    expect(again.recipe).toEqual({ ...bare, segments: [] });
    expect([again.landmarks.map(({ name }) => name), again.planes.map(({ id }) => id)]).toEqual([["pogonion"], ["occlusal"]]);
  });
});

test("a key of a later version raises the version, and only that", () => {
  expect(withValue(MOVED, ["spacing_mm"], 2).version).toBe(1);
  expect(withValue(MOVED, ["head_frame", "horizontal"], { point_mm: [0, 0, 0], normal: [0, 0, 1] }).version).toBe(3);
  expect(withValue(MOVED, ["landmarks", "points_mm", "pogonion"], [1, 2, 3]).version).toBe(6);
  expect(withSegment(MOVED, 0, { dissected_mm: 12 }).version).toBe(7);
  expect(schemaProblem(withSegment(MOVED, 0, { dissected_mm: 12 }))).toBe("");
});

test("what is removed leaves no empty object behind", () => {
  const placed = withValue(MOVED, ["landmarks", "points_mm", "pogonion"], [1, 2, 3]);
  expect(withValue(placed, ["landmarks", "points_mm", "pogonion"], undefined)).not.toHaveProperty("landmarks");
  expect(withSegment(MOVED, 0, { pose: undefined }).segments[0]).toEqual({ name: "mandible", osteotomy: "bssro" });
});

test("changes leave what they were made from", () => {
  const before = structuredClone(MOVED);
  withSegments(withValue(withSegment(MOVED, 0, { name: "x" }), ["ct", "hu_offset"], -1024), []);
  expect(MOVED).toEqual(before);
});

test("numbers of a hand are rounded, without a negative zero", () => {
  const vector = rounded([1.23456789, -0.00000001, -5]);
  expect(vector).toEqual([1.2346, 0, -5]);
  expect(Object.is(vector[1], -0)).toBe(false);
});
