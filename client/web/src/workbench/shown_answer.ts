// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Evaluation } from "../evaluation/answer_evaluator";
import type { SolveSummary } from "../generated/tissueform/v1/deform_service_pb";
import type { Prediction } from "../generated/tissueform/v1/prediction_pb";
import type { DeformationModel } from "../generated/tissueform/v1/session_pb";
import { formatNumber } from "../planning/numbers";
import type { Comparison } from "./comparison";

/** Whose answer a face is, and what is known of how good it is. */
export type ShownAnswer =
  | { by: "server"; summary: SolveSummary; isRefining: boolean }
  | ({ by: "page" } & Pick<Evaluation, "errorBoundMm" | "isEstimate">);

/** How near it is to the full answer of its model, in a sentence; "" without an answer yet. */
export function describeAnswer(answer: ShownAnswer | null): string {
  if (answer === null) return "";
  if (answer.by === "page") return answer.isEstimate ? estimate(answer.errorBoundMm) : prepared(answer.errorBoundMm);
  const { summary, isRefining } = answer;
  // An estimate has no bound, and what is still iterated has neither.
  if (summary.prepared) return isRefining || summary.errorEstimateMm > 0 ? estimate(summary.errorEstimateMm) : prepared(summary.errorBoundMm);
  if (isRefining) return "An early answer without an error estimate; a better one follows.";
  if (!summary.converged) return `The full answer was not reached (${formatNumber(100 * summary.load, 0)} % of the move)${summary.obstacle === "" ? "." : `: ${summary.obstacle}.`}`;
  return "Full answer.";
}

/** The same of the face that is shown, with a comparison or without. */
export function describeFace(answer: ShownAnswer | null, comparison: Comparison | null): string {
  if (comparison === null) return describeAnswer(answer);
  const stored = storedFace(comparison);
  if (stored !== null) return `A stored prediction. ${stored.summary === undefined ? "" : describeAnswer({ by: "server", summary: stored.summary, isRefining: false })}`.trim();
  if (comparison.share > 0) return "Between two faces: not an answer of a model.";
  return comparison.from === "rest" ? "Pre-op face." : describeAnswer(answer);
}

/** The prediction that a comparison shows; null where it shows another face, or what lies between two. */
function storedFace({ from, to, share }: Comparison): Prediction | null {
  if (share === 1) return to;
  return share === 0 && typeof from === "object" ? from : null;
}

/** The model whose answer is shown. `planned`: that of the plan. */
export function modelShown(comparison: Comparison | null, planned: DeformationModel): DeformationModel {
  return (comparison === null ? null : storedFace(comparison))?.model ?? planned;
}

function prepared(errorMm: number): string {
  return `Prepared answer, within ${atLeastShown(errorMm)} mm of the full one.`;
}

function estimate(errorMm: number): string {
  return `Estimate, within about ${atLeastShown(errorMm)} mm; the full answer follows.`;
}

/** What is less than is shown is no "0.00". */
function atLeastShown(mm: number): string {
  return formatNumber(Math.max(mm, 0.01), 2);
}
