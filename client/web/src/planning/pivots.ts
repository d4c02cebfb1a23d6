// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { HandleEntry, LandmarkEntry } from "../case/manifest";
import type { Vector } from "../geometry/rotation";
import { formatNumber } from "./numbers";

/** A point about which a segment may turn, at rest, LPS. */
export interface PivotChoice {
  value: Vector;
  label: string;
}

/** `middle`: of the segment's surfaces; null where it has none. */
export function pivotChoices(handle: Pick<HandleEntry, "name" | "pivotMm">, landmarks: readonly LandmarkEntry[], middle: Vector | null): PivotChoice[] {
  return [
    { value: handle.pivotMm, label: "The case’s pivot" },
    ...(middle === null ? [] : [{ value: middle, label: "Middle of the segment" }]),
    ...landmarks.filter((landmark) => landmark.handle === handle.name).map(({ positionMm, label }) => ({ value: positionMm, label })),
  ];
}

/** "The case’s pivot (1.0, −2.0, 30.5)": which it is, and where, for readers of numbers that refer to it. */
export function pivotText(choices: readonly PivotChoice[], pivot: Vector): string {
  const place = `(${pivot.map((part) => formatNumber(part)).join(", ")})`;
  const choice = choices.find(({ value }) => value.every((part, axis) => part === pivot[axis]));
  return choice === undefined ? place : `${choice.label} ${place}`;
}
