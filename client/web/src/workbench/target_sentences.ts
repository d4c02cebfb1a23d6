// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { FitBound, type FitResponse, type FittedNumber } from "../generated/tissueform/v1/plan_service_pb";
import { formatNumber } from "../planning/numbers";
import type { Target } from "./target_fit";

type Named = readonly { name: string; label: string }[];

/** What becomes of targets, one thing a sentence: each reached or missed, those that contradict each other, what holds back. `limitShare`: of TargetFit. */
export function targetSentences(response: FitResponse, targets: readonly Pick<Target, "label">[], handles: Named, limitShare: number): string[] {
  const label = (name: string) => targets[Number(name.replace("target ", "")) - 1]?.label ?? name;
  const held = response.numbers.filter(({ bound }) => bound !== FitBound.UNSPECIFIED);
  return [
    ...response.targets.map(({ name, reached, missedMm }) => {
      if (reached) return `${label(name)}: reached, within ${formatNumber(Math.max(missedMm, 0.01), 2)} mm.`;
      return `${label(name)}: cannot be reached; ${formatNumber(missedMm)} mm are missing.`;
    }),
    ...response.contradictions.map(({ first, second }) => `${label(first)} and ${label(second)} conflict: they require different movements of the same bone.`),
    ...(held.length === 0 ? [] : [`At its limit${aslant(limitShare)}: ${held.map((number) => numberName(number, handles)).join(", ")}.`]),
    ...(response.converged ? [] : ["The search did not converge; choose a smaller target."]),
  ];
}

/** What is asked for goes no further than this part of a limit; what is moved by hand does. */
function aslant(limitShare: number): string {
  return limitShare > 0.995 ? "" : ` (the head is oblique in the scan: the search uses ${formatNumber(100 * limitShare, 0)} % of the case’s limits)`;
}

const SHIFTS = ["to the left", "to the back", "up"];
const TURNS = ["about left", "about back", "about up"];

export function numberName({ handle, isRotation, axis }: FittedNumber, handles: Named): string {
  const label = handles.find(({ name }) => name === handle)?.label ?? handle;
  return `${label} ${(isRotation ? TURNS : SHIFTS)[axis] ?? ""}`;
}
