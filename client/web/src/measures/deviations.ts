// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { baseOf } from "../calls/gateway";
import type { Vector } from "../geometry/rotation";

/** By how much surgery and the model err: standard deviations, as of core/planning/outcome/deviations.h. */
export interface Deviations {
  source: string;
  /** Of a segment along and about the patient's left, back and top. */
  translationMm: Vector;
  rotationDeg: Vector;
  /** By which a predicted place of the skin is off along its normal though bone lies as planned: by place, "default" elsewhere. */
  modelMm: ReadonlyMap<string, number>;
}

/** Of all operations together, and of those that have figures of their own. */
export interface DeviationTable {
  all: Deviations;
  operations: ReadonlyMap<string, Deviations>;
}

const ALL: Deviations = {
  source: "published",
  translationMm: [0.82, 1.1, 1.27],
  rotationDeg: [1.17, 1.17, 1.17],
  modelMm: new Map([["default", 0.89], ["lower_lip", 1.5], ["upper_lip", 1.5]]),
};

/** Those of the command (a test compares). Sources: docs/accuracy.md, "The whole band". */
export const PUBLISHED: DeviationTable = {
  all: ALL,
  operations: new Map([["bsso_forward", { ...ALL, source: "published, bsso_forward", modelMm: new Map(ALL.modelMm).set("default", 1.13) }]]),
};

/** The place of the face that a landmark of the skin belongs to, by its name in `Deviations.modelMm`. */
const PLACES: Record<string, string> = {
  columella: "nose",
  labrale_inferius: "lower_lip",
  labrale_superius: "upper_lip",
  pronasale: "nose",
  soft_menton: "chin",
  soft_pogonion: "chin",
  stomion_inferius: "lower_lip",
  stomion_superius: "upper_lip",
  sublabiale: "chin",
  subnasale: "nose",
};

/** The model's deviation at a landmark of the skin. */
export function modelDeviation({ modelMm }: Deviations, landmark: string): number {
  return modelMm.get(PLACES[landmark] ?? "default") ?? modelMm.get("default") as number;
}

const LONGEST_SOURCE = 120;
const DEADLINE_MS = 10_000;

/** What the gateway's /config.json has as `deviations`: nothing is left out. Throws where it is something else. */
export function readDeviations(json: unknown): DeviationTable {
  const operations = objectOf(objectOf(json).operations ?? {});
  return { all: readEntry(json), operations: new Map(Object.entries(operations).map(([name, entry]) => [name, readEntry(entry)])) };
}

function readEntry(json: unknown): Deviations {
  const { source, surgery, model_mm: model } = objectOf(json);
  const { translation_mm: translation, rotation_deg: rotation } = objectOf(surgery);
  const modelMm = new Map(Object.entries(objectOf(model)).map(([place, mm]) => [place, numberOf(mm)]));
  if (typeof source !== "string" || !modelMm.has("default")) throw wrong();
  return { source: source.slice(0, LONGEST_SOURCE), translationMm: axesOf(translation), rotationDeg: axesOf(rotation), modelMm };
}

function wrong(): Error {
  return new Error("the gateway's deviations cannot be read");
}

function objectOf(json: unknown): Record<string, unknown> {
  if (typeof json !== "object" || json === null || Array.isArray(json)) throw wrong();
  return json as Record<string, unknown>;
}

function numberOf(json: unknown): number {
  if (typeof json !== "number" || !(json >= 0)) throw wrong();
  return json;
}

function axesOf(json: unknown): Vector {
  if (!Array.isArray(json) || json.length !== 3) throw wrong();
  return json.map(numberOf) as Vector;
}

/** Of which operation the figures are; "": of all together. */
export const chosen = { operation: "" };

let known: Promise<DeviationTable> | null = null;

/** The clinic's where the gateway has some, else the published ones. Rejects where the gateway does not answer. */
export function deviationTable(): Promise<DeviationTable> {
  known ??= fetchTable().catch((error: unknown) => {
    known = null;
    throw error;
  });
  return known;
}

/** Of the chosen operation. */
export async function deviationsInUse(): Promise<Deviations> {
  const { all, operations } = await deviationTable();
  return operations.get(chosen.operation) ?? all;
}

async function fetchTable(): Promise<DeviationTable> {
  // A moving file has no gateway.
  if (!globalThis.location?.protocol.startsWith("http")) return PUBLISHED;
  const response = await fetch(`${baseOf(location.href)}/config.json`, { cache: "no-store", signal: AbortSignal.timeout(DEADLINE_MS) });
  if (response.status === 404) return PUBLISHED;
  if (!response.ok) throw wrong();
  const { deviations } = objectOf(await response.json());
  return deviations === undefined ? PUBLISHED : readDeviations(deviations);
}
