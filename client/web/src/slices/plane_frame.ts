// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type Vector, add, cross, dot, norm, scaled, subtract } from "../geometry/rotation";
import type { Directions } from "../volume/volume";

export type Plane = "axial" | "coronal" | "sagittal";

export const PLANES: readonly Plane[] = ["axial", "coronal", "sagittal"];
export const LPS: Directions = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];

/** How a plane is drawn: unit vectors in LPS. */
export interface PlaneFrame {
  readonly right: Vector;
  readonly down: Vector;
  /** Where the slices go to with growing position: left, posterior or superior. */
  readonly normal: Vector;
}

/** Radiological convention: the patient's right is on the left of the screen; a sagittal slice shows the face at the left. `axes` point left, posterior and superior. */
export function planeFrame(plane: Plane, [left, posterior, superior]: Directions): PlaneFrame {
  if (plane === "axial") return { right: left, down: posterior, normal: superior };
  if (plane === "coronal") return { right: left, down: scaled(superior, -1), normal: posterior };
  return { right: posterior, down: scaled(superior, -1), normal: left };
}

/** The letter of the direction of LPS that is nearest. */
export function letterOf(direction: Vector): string {
  const sizes = direction.map(Math.abs);
  const axis = sizes.indexOf(Math.max(...sizes));
  return (direction[axis] >= 0 ? "LPS" : "RAI")[axis];
}

/** Of a slice at `mm` along `normal`: "S 12.3 mm", or "I 12.3 mm" for a negative position. */
export function positionText(normal: Vector, mm: number): string {
  const letter = letterOf(mm < 0 ? scaled(normal, -1) : normal);
  return `${letter} ${Math.abs(mm).toFixed(1)} mm`;
}

export function distanceMm(a: Vector, b: Vector): number {
  return norm(subtract(a, b));
}

/** At `corner`, from 0 to 180 degrees. */
export function angleDeg(a: Vector, corner: Vector, b: Vector): number {
  const [u, v] = [subtract(a, corner), subtract(b, corner)];
  return (Math.atan2(norm(cross(u, v)), dot(u, v)) * 180) / Math.PI;
}

/** Moves a point along `normal` into the plane through `inPlane`. */
export function ontoPlane(point: Vector, inPlane: Vector, normal: Vector): Vector {
  return add(point, scaled(normal, dot(normal, subtract(inPlane, point))));
}

/** Where a plane cuts a slice: the direction of the line, and its point nearest to the plane's point; null where they are nearly parallel. */
export function lineInSlice(point: Vector, normal: Vector, inSlice: Vector, sliceNormal: Vector): { at: Vector; along: Vector } | null {
  const along = cross(sliceNormal, normal);
  const sine = norm(along) / norm(normal);
  if (sine < 0.05) return null;
  const across = subtract(normal, scaled(sliceNormal, dot(normal, sliceNormal)));
  const projected = ontoPlane(point, inSlice, sliceNormal);
  const missing = dot(normal, subtract(point, projected)) / dot(normal, across);
  return { at: add(projected, scaled(across, missing)), along: scaled(along, 1 / norm(along)) };
}
