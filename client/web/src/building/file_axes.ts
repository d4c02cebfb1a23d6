// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type Vector, add, scaled } from "../geometry/rotation";
import type { Directions, Grid } from "../volume/volume";

// "ct.axes" of a recipe, as core/imaging/ct/patient_axes.cc reads it: for files that do not say how they lie in the patient.

const TOWARD = "LPS";
const FROM = "RAI";

/** Whether they are three letters of L R A P S I, one of each pair. */
export function areAxes(axes: string): boolean {
  const seen = Array.from(axes, (letter) => Math.max(TOWARD.indexOf(letter), FROM.indexOf(letter)));
  return axes.length === 3 && [0, 1, 2].every((axis) => seen.includes(axis));
}

/** The grid with these directions of its axes; its origin is laid along them. REQUIRES: areAxes(axes). */
export function axesGrid(grid: Grid, axes: string): Grid {
  const directions = Array.from(axes, (letter) => {
    const direction: Vector = [0, 0, 0];
    const axis = TOWARD.indexOf(letter);
    direction[axis >= 0 ? axis : FROM.indexOf(letter)] = axis >= 0 ? 1 : -1;
    return direction;
  }) as unknown as Directions;
  const origin = directions.reduce<Vector>((sum, direction, axis) => add(sum, scaled(direction, grid.origin[axis])), [0, 0, 0]);
  return { ...grid, directions, origin };
}
