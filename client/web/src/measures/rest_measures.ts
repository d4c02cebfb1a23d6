// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { MeasureResult } from "./evaluation";
import { type ShownFace, measureFace } from "./face_measures";
import type { MovementBand } from "./movement_bands";
import type { PlanAnswers } from "./whole_band";

/**
 * The measures with the interval of surgery, model and material together; with that of the material alone where the face is not
 * the plan's, or the page cannot answer. Takes a dozen answers of few points for each moved segment.
 */
export async function measureAtRest(face: ShownFace, answers: PlanAnswers): Promise<MeasureResult[]> {
  const results = measureFace(face);
  if (!face.showsPlan) return results;
  const bands = await import("./whole_band").then(({ wholeBands }) => wholeBands(face, answers)).catch(() => null);
  if (bands === null) return results;
  return results.map((result) => (result.kind === "value" ? { ...result, band: bands.get(result.definition.name) ?? result.band } : result));
}

/** Of each of the case's landmarks, likewise; null where `measureAtRest` knows the material's interval alone. */
export async function movementBandsAtRest(face: ShownFace, answers: PlanAnswers): Promise<(MovementBand | null)[] | null> {
  if (!face.showsPlan) return null;
  return import("./movement_bands").then(({ movementBands }) => movementBands(face, answers)).catch(() => null);
}
