// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type Vector, add, cross, scaled, subtract } from "../geometry/rotation";
import type { Volume } from "../volume/volume";
import { OUTSIDE, sampleVolume } from "./sampling";

// Whether a CT is the one that a case was made from. A case names no frame of reference: what both have is the skin. The values need
// not be HU: those within the case's skin and those without it say where tissue begins.

/** A surface at rest, counter-clockwise seen from outside. */
export interface Skin {
  readonly positions: Float32Array;
  readonly triangles: Uint32Array;
}

export interface CtFit {
  /** Of the points, those with the CT's skin within NEAR_MM. */
  readonly share: number;
  readonly points: number;
}

export const NEAR_MM = 3;
/** A case's skin has parts that its CT cuts off or that were smoothed. */
const LEAST_SHARE = 0.7;
const MOST_POINTS = 2000;
const REACH_MM = 10;
const STEP_MM = 0.5;
/** Tissue and air differ by about 1000 HU; noise by less than this. */
const LEAST_CONTRAST = 300;
/** So far from the skin are tissue and air looked for. */
const DEPTH_MM = 6;
const MIDDLE = REACH_MM / STEP_MM;

/** Values along the normal of one point of the skin, from within to without; null where the CT does not reach. */
function profileOf(volume: Volume, point: Vector, normal: Vector): Int16Array | null {
  const values = new Int16Array(2 * MIDDLE + 1);
  sampleVolume(volume, { origin: subtract(point, scaled(normal, REACH_MM)), right: scaled(normal, STEP_MM), down: [0, 0, 0], width: values.length, height: 1 }, values);
  return values.includes(OUTSIDE) ? null : values;
}

function median(values: readonly number[]): number {
  return [...values].sort((a, b) => a - b)[values.length >> 1];
}

/** How far from the middle of a profile tissue ends. */
function skinMm(profile: Int16Array, threshold: number): number {
  let nearest = Infinity;
  for (let i = 0; i + 1 < profile.length; ++i) {
    if (profile[i] >= threshold && profile[i + 1] < threshold) nearest = Math.min(nearest, Math.abs(i + 0.5 - MIDDLE) * STEP_MM);
  }
  return nearest;
}

export function fitOfCt(volume: Volume, skins: readonly Skin[]): CtFit {
  const all = skins.flatMap(pointsOf);
  const every = Math.max(1, Math.ceil(all.length / MOST_POINTS));
  const points = all.filter((_, index) => index % every === 0);
  const profiles = points.map(({ point, normal }) => profileOf(volume, point, normal)).filter((profile) => profile !== null);
  if (profiles.length === 0) return { share: 0, points: points.length };
  const [tissue, air] = [-1, 1].map((side) => median(profiles.map((profile) => profile[MIDDLE + side * (DEPTH_MM / STEP_MM)])));
  const near = tissue - air < LEAST_CONTRAST ? [] : profiles.filter((profile) => skinMm(profile, (tissue + air) / 2) <= NEAR_MM);
  return { share: near.length / points.length, points: points.length };
}

/** One sentence; empty where the CT belongs to the skin. */
export function objectionToCt({ share }: CtFit): string {
  if (share >= LEAST_SHARE) return "";
  return `this CT does not belong to the case: only ${(100 * share).toFixed(0)} % of the case's skin has skin of the CT within ${NEAR_MM} mm; open the CT that the case was built from`;
}

interface SkinPoint {
  readonly point: Vector;
  readonly normal: Vector;
}

/** Vertices with their normals; those of no triangle have none and are left out. */
function pointsOf({ positions, triangles }: Skin): SkinPoint[] {
  const at = (vertex: number): Vector => [positions[3 * vertex], positions[3 * vertex + 1], positions[3 * vertex + 2]];
  const normals: (Vector | undefined)[] = new Array(positions.length / 3);
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [triangles[t], triangles[t + 1], triangles[t + 2]];
    const area = cross(subtract(at(b), at(a)), subtract(at(c), at(a)));
    for (const vertex of [a, b, c]) normals[vertex] = add(normals[vertex] ?? [0, 0, 0], area);
  }
  return normals.flatMap((normal, vertex) => {
    const length = normal === undefined ? 0 : Math.hypot(...normal);
    return normal === undefined || length === 0 ? [] : [{ point: at(vertex), normal: scaled(normal, 1 / length) }];
  });
}
