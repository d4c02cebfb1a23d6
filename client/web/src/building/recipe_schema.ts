// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import schemaText from "../../../../docs/recipe.schema.json?raw";

/** The part of JSON Schema (draft 07) that docs/recipe.schema.json uses. */
interface Schema {
  type?: string;
  const?: unknown;
  enum?: unknown[];
  required?: string[];
  properties?: Record<string, Schema>;
  additionalProperties?: boolean | Schema;
  minProperties?: number;
  items?: Schema;
  minItems?: number;
  maxItems?: number;
  minLength?: number;
  maxLength?: number;
  pattern?: string;
  minimum?: number;
  maximum?: number;
  exclusiveMinimum?: number;
  exclusiveMaximum?: number;
  anyOf?: Schema[];
  $ref?: string;
  /** Version of the recipe format that has the key first. */
  since_version?: number;
}

const ROOT = JSON.parse(schemaText) as Schema & { definitions: Record<string, Schema> };
const FIRST_VERSION = 1;

/** What is wrong with `json` as a recipe, with its place; "" for a valid one. */
export function schemaProblem(json: unknown): string {
  return problemOf(json, ROOT, "");
}

/** The lowest version of the format that has every key of `json`. */
export function leastVersion(json: unknown, schema: Schema = ROOT): number {
  const { items, properties, additionalProperties, since_version = FIRST_VERSION } = resolved(schema);
  const versions = [since_version];
  if (Array.isArray(json)) versions.push(...json.map((item) => leastVersion(item, items ?? {})));
  else if (isObject(json)) {
    const others = typeof additionalProperties === "object" ? additionalProperties : {};
    versions.push(...Object.entries(json).map(([key, value]) => leastVersion(value, properties?.[key] ?? others)));
  }
  return Math.max(...versions);
}

/** Keys beside a reference count as well as those of what it names. */
function resolved(schema: Schema): Schema {
  if (schema.$ref === undefined) return schema;
  return { ...ROOT.definitions[schema.$ref.replace("#/definitions/", "")], ...schema };
}

function isObject(json: unknown): json is Record<string, unknown> {
  return typeof json === "object" && json !== null && !Array.isArray(json);
}

function problemOf(json: unknown, unresolved: Schema, place: string): string {
  const schema = resolved(unresolved);
  const at = place === "" ? "the recipe" : place;
  if (schema.anyOf !== undefined) {
    const problems = schema.anyOf.map((one) => problemOf(json, one, place));
    return problems.includes("") ? "" : problems[problems.length - 1];
  }
  if (schema.const !== undefined && json !== schema.const) return `${at} must be ${JSON.stringify(schema.const)}`;
  if (schema.enum !== undefined && !schema.enum.includes(json)) return `${at} must be one of ${schema.enum.map((value) => JSON.stringify(value)).join(", ")}`;
  switch (schema.type) {
    case "object":
      return isObject(json) ? objectProblem(json, schema, place) : `${at} must be an object`;
    case "array":
      return Array.isArray(json) ? arrayProblem(json, schema, place) : `${at} must be a list`;
    case "string":
      return typeof json === "string" ? textProblem(json, schema, at) : `${at} must be text`;
    case "boolean":
      return typeof json === "boolean" ? "" : `${at} must be true or false`;
    case "integer":
    case "number":
      return numberProblem(json, schema, at);
    default:
      return "";
  }
}

function objectProblem(json: Record<string, unknown>, schema: Schema, place: string): string {
  const missing = (schema.required ?? []).find((key) => !(key in json));
  if (missing !== undefined) return `${place === "" ? "the recipe" : place} has no "${missing}"`;
  if (Object.keys(json).length < (schema.minProperties ?? 0)) return `${place} is empty`;
  for (const [key, value] of Object.entries(json)) {
    const known = Object.hasOwn(schema.properties ?? {}, key) ? schema.properties?.[key] : undefined;
    const allowed = known ?? schema.additionalProperties ?? true;
    const at = place === "" ? key : `${place}.${key}`;
    if (allowed === false) return `the key "${at}" is unknown`;
    const problem = allowed === true ? "" : problemOf(value, allowed, at);
    if (problem !== "") return problem;
  }
  return "";
}

function arrayProblem(json: unknown[], schema: Schema, place: string): string {
  if (json.length < (schema.minItems ?? 0)) return `${place} needs at least ${schema.minItems} entries`;
  if (json.length > (schema.maxItems ?? Infinity)) return `${place} has more than ${schema.maxItems} entries`;
  return json.map((item, index) => problemOf(item, schema.items ?? {}, `${place}[${index}]`)).find((problem) => problem !== "") ?? "";
}

function textProblem(json: string, schema: Schema, at: string): string {
  if (json.length < (schema.minLength ?? 0)) return `${at} is empty`;
  if (json.length > (schema.maxLength ?? Infinity)) return `${at} has more than ${schema.maxLength} characters`;
  return schema.pattern === undefined || new RegExp(schema.pattern).test(json) ? "" : `${at} must match ${schema.pattern}`;
}

function numberProblem(json: unknown, schema: Schema, at: string): string {
  if (typeof json !== "number" || !Number.isFinite(json)) return `${at} must be a number`;
  if (schema.type === "integer" && !Number.isInteger(json)) return `${at} must be a whole number`;
  const { minimum = -Infinity, maximum = Infinity, exclusiveMinimum = -Infinity, exclusiveMaximum = Infinity } = schema;
  if (json < minimum || json <= exclusiveMinimum) return `${at} must be ${json < minimum ? `at least ${minimum}` : `more than ${exclusiveMinimum}`}`;
  if (json > maximum || json >= exclusiveMaximum) return `${at} must be ${json > maximum ? `at most ${maximum}` : `less than ${exclusiveMaximum}`}`;
  return "";
}
