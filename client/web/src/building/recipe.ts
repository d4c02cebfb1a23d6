// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Vector } from "../geometry/rotation";
import { leastVersion, schemaProblem } from "./recipe_schema";

// The recipe that a plan is built from (docs/recipe-format.md). The page edits the JSON itself, so that keys it offers nothing for
// stay as they are.

export type Osteotomy = "bssro" | "le_fort_1" | "genioplasty";

/** Points with (p - point) . normal >= 0 are on its positive side; the normal has any length. */
export interface Plane {
  point_mm: Vector;
  normal: Vector;
}

/** Of a recipe: may name a file instead, which the page does not show. */
export type RecipePlane = Plane | { file: string; name?: string; flip?: boolean };

/** LPS, mm and degrees; x = pivot + scale R (v - pivot) + translation. */
export interface RecipePose {
  translation_mm?: Vector;
  rotation_vector_deg?: Vector;
  pivot_mm?: Vector;
  scale?: number;
}

export interface RecipeSegment {
  name: string;
  osteotomy?: Osteotomy;
  planes?: RecipePlane[];
  pose?: RecipePose;
  dissected_mm?: number;
  [key: string]: unknown;
}

export interface Recipe {
  format: "tissueform-recipe";
  version: number;
  segments: RecipeSegment[];
  ct?: { hu_offset?: number; axes?: string; [key: string]: unknown };
  labels?: { names?: Record<string, (string | number)[]>; [key: string]: unknown };
  segmentation?: { bone_above_hu?: number; [key: string]: unknown };
  landmarks?: { points_mm?: Record<string, Vector>; [key: string]: unknown };
  occlusal_plane?: RecipePlane;
  head_frame?: { midsagittal?: RecipePlane; horizontal?: RecipePlane };
  [key: string]: unknown;
}

/** Nothing moves yet: a recipe has at least one segment before it is sent. */
export const EMPTY_RECIPE: Recipe = { format: "tissueform-recipe", version: 1, segments: [] };

const DECIMALS = 4;

export function hasPoint(plane: RecipePlane | undefined): plane is Plane {
  return plane !== undefined && "point_mm" in plane && "normal" in plane;
}

/** As it is shown, stored and sent: one text for one recipe. */
export function recipeText(recipe: Recipe): string {
  return `${JSON.stringify(recipe, null, 2)}\n`;
}

/** Throws an Error with one sentence that names the place. */
export function parseRecipe(text: string): Recipe {
  return checked(jsonOf(text)) as Recipe;
}

/** As parseRecipe, for one that may have no segments yet: they are the empty list then. */
export function parseDraft(text: string): Recipe {
  const json = jsonOf(text);
  if (!isRecord(json) || (json.segments !== undefined && !(Array.isArray(json.segments) && json.segments.length === 0))) return checked(json) as Recipe;
  checked({ ...json, segments: [{ name: "segment" }] });
  return { ...json, segments: [] } as unknown as Recipe;
}

function jsonOf(text: string): unknown {
  try {
    return JSON.parse(text);
  } catch (thrown) {
    throw new Error(`the recipe is not JSON: ${thrown instanceof Error ? thrown.message : String(thrown)}`);
  }
}

function isRecord(json: unknown): json is Record<string, unknown> {
  return typeof json === "object" && json !== null && !Array.isArray(json);
}

function checked(json: unknown): unknown {
  const problem = schemaProblem(json);
  if (problem !== "") throw new Error(`the recipe cannot be used: ${problem}`);
  return json;
}

/** The recipe with `value` at `path`; undefined removes the key, and objects that become empty. The version rises where a key needs it. */
export function withValue(recipe: Recipe, path: readonly string[], value: unknown): Recipe {
  const changed = placed(recipe, path, value) as Recipe;
  return versioned(changed);
}

export function withSegments(recipe: Recipe, segments: RecipeSegment[]): Recipe {
  return versioned({ ...recipe, segments });
}

export function withSegment(recipe: Recipe, index: number, change: Partial<RecipeSegment>): Recipe {
  const changed = { ...recipe.segments[index], ...change };
  const kept = Object.fromEntries(Object.entries(changed).filter(([, value]) => value !== undefined)) as RecipeSegment;
  return withSegments(recipe, recipe.segments.map((segment, at) => (at === index ? kept : segment)));
}

/** Numbers of a hand need no more digits: a tenth of a micrometer. */
export function rounded(vector: Vector): Vector {
  return vector.map((value) => Number(value.toFixed(DECIMALS)) + 0) as Vector;
}

/** Normals keep their directions to 1e-9. */
export function roundedPlane({ point_mm, normal }: Plane): Plane {
  return { point_mm: rounded(point_mm), normal: normal.map((value) => Number(value.toFixed(9)) + 0) as Vector };
}

function versioned(recipe: Recipe): Recipe {
  return { ...recipe, version: Math.max(recipe.version, leastVersion(recipe)) };
}

function placed(object: object, [key, ...rest]: readonly string[], value: unknown): object {
  const copy: Record<string, unknown> = { ...object };
  const next = rest.length === 0 ? value : placed((copy[key] as object | undefined) ?? {}, rest, value);
  const isEmpty = next === undefined || (rest.length > 0 && Object.keys(next as object).length === 0);
  if (isEmpty) delete copy[key];
  else copy[key] = next;
  return copy;
}
