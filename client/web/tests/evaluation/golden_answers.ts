// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { readFileSync } from "node:fs";
import { fileURLToPath } from "node:url";
import { AnswerEvaluator } from "../../src/evaluation/answer_evaluator";
import { evaluatorModule } from "../../src/evaluation/evaluator_module";
import type { Pose } from "../../src/geometry/pose";

const FOLDER = fileURLToPath(new URL("../../../../tests/data/prepared_answers/", import.meta.url));

export const GOLDEN = ["gradient_field", "linear_elastic", "linear_elastic_band", "linear_elastic_contact", "linear_elastic_seal", "neo_hookean", "neo_hookean_third_order"] as const;

export interface GoldenCase {
  poses: Pose[];
  isCovered: boolean;
  errorMm: number;
  positionsMm: number[];
  /** Where the bytes have columns of the band, and no handle turns too far for one. */
  bandMm: number[] | null;
}

export function goldenBytes(name: string): Uint8Array {
  return Uint8Array.from(readFileSync(`${FOLDER}${name}.bin`));
}

export async function openBytes(bytes: Uint8Array, sha256?: string): Promise<AnswerEvaluator> {
  return AnswerEvaluator.open(bytes, await evaluatorModule(), sha256);
}

export const openGolden = (name: string) => openBytes(goldenBytes(name));

export function goldenCases(name: string): GoldenCase[] {
  const { cases } = JSON.parse(readFileSync(`${FOLDER}${name}.json`, "utf8")) as { cases: any[] };
  return cases.map((one) => ({
    poses: one.poses.map((pose: any) => ({
      rotationVector: pose.rotation_vector,
      pivotMm: pose.pivot_mm,
      translationMm: pose.translation_mm,
      scale: pose.scale,
    })),
    isCovered: one.covered,
    errorMm: one.error_mm,
    positionsMm: one.positions_mm,
    bandMm: one.band_mm?.length > 0 ? one.band_mm : null,
  }));
}
