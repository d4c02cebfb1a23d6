// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { vertexNormals } from "../geometry/following_surface";
import type { Vector } from "../geometry/rotation";
import type { Triangles } from "../measures/anchor";
import { type BoundPhotograph, type Photograph, pointTriangles } from "../movingdata/photograph_data";
import { type Similarity, spreadOffLine, transformAll } from "./point_fit";
import { type Ball, type Fit, SkinFit, samplesOf } from "./skin_fit";
import { TriangleGrid } from "./triangle_grid";

/** What a photograph is registered to, and by which points. */
export interface RegistrationTask {
  photograph: Photograph;
  /** All skins as one: #V by 3, mm, LPS. */
  skin: { positions: Float32Array<ArrayBuffer>; triangles: Uint32Array<ArrayBuffer> };
  /** Three to six on the photograph, and the same on the skin. */
  from: Vector[];
  to: Vector[];
  /** The size of the photograph is not known: a scale is fitted, too. */
  isScaled: boolean;
  masked: Ball[];
}

export interface Registration {
  bound: BoundPhotograph;
  map: Similarity;
  medianMm: number;
  percentile95Mm: number;
  /** #V of the photograph: distance to the skin, at most FAR_MM. */
  distancesMm: Float32Array<ArrayBuffer>;
  /** Sentences for the user; empty where all is good. */
  warnings: string[];
}

export const MIN_LANDMARKS = 3;
export const MAX_LANDMARKS = 6;
const LEAST_SPREAD_MM = 5;
const WARN_MEDIAN_MM = 1.5;
/** Of the median of the face, or of its 95th percentile: other people's faces differ by 2 to 3 mm in the median, and by far more where they differ. */
const REFUSE_MEDIAN_MM = 4;
const REFUSE_PERCENTILE_MM = 5;
/** A face is nearly its own mirror image: a mirrored one that is a little better proves nothing. */
const MIRRORED_GAIN = 0.8;
/** Up to NEAR the photograph keeps its distance along the turning normal; that fades until FADED. */
const NEAR_MM = 5;
const FADED_MM = 10;
/** From here the skin's movement fades, and ends at FAR. */
const FOLLOWING_MM = 20;
export const FAR_MM = 40;

/** Throws an Error in a sentence where the photograph does not belong to the skin. */
export function register(task: RegistrationTask): Registration {
  const { photograph, skin, isScaled, masked } = task;
  checkLandmarks(task);
  const fitter = new SkinFit(skin, masked);
  const triangles = pointTriangles(photograph);
  const fit = fitter.fit(samplesOf({ positions: photograph.positions, triangles }), task.from, task.to, isScaled);
  const mirrored = fitter.fit(samplesOf({ positions: mirror(photograph.positions), triangles: turned(triangles) }), task.from.map(mirrorPoint), task.to, isScaled);
  checkFit(fit, mirrored);
  const warnings: string[] = [];
  if (fit.medianMm > WARN_MEDIAN_MM) warnings.push(`The photograph is ${fit.medianMm.toFixed(1)} mm (median) from the CT's skin: check the landmarks, and whether the expression is the same.`);
  if (isScaled) warnings.push(`The photograph had no known size and was scaled by ${fit.map.scale.toPrecision(4)}: its shape cannot confirm distances.`);
  if (isTextureMirrored(photograph, triangles)) warnings.push("The texture coordinates are mirrored: check that a mole or the parting of the hair is on the right side.");
  const placed = { ...photograph, positions: transformAll(fit.map, photograph.positions) };
  return { ...bind(placed, triangles, skin), map: fit.map, medianMm: fit.medianMm, percentile95Mm: fit.percentile95Mm, warnings };
}

function checkLandmarks({ from, to }: RegistrationTask): void {
  if (from.length < MIN_LANDMARKS || from.length > MAX_LANDMARKS) throw new Error(`${from.length} landmarks are marked on both surfaces: mark ${MIN_LANDMARKS} to ${MAX_LANDMARKS}`);
  if (spreadOffLine(to) < LEAST_SPREAD_MM) throw new Error("the landmarks are nearly on one line: mark one more beside it");
}

function checkFit(fit: Fit, mirrored: Fit): void {
  const { medianMm, percentile95Mm } = fit;
  if (mirrored.medianMm < MIRRORED_GAIN * medianMm && mirrored.percentile95Mm < REFUSE_PERCENTILE_MM) {
    throw new Error("the photograph is mirrored: its mirror image fits the CT better; export it again without mirroring");
  }
  if (medianMm > REFUSE_MEDIAN_MM || percentile95Mm > REFUSE_PERCENTILE_MM) {
    throw new Error(
      `a photograph of another person, or of another expression: the face is ${medianMm.toFixed(1)} mm (median) and ${percentile95Mm.toFixed(1)} mm (95 %) from the CT's skin; check the landmarks, or take another photograph`,
    );
  }
}

const mirrorPoint = ([x, y, z]: Vector): Vector => [-x, y, z];

function mirror(positions: Float32Array): Float32Array<ArrayBuffer> {
  return Float32Array.from(positions, (value, i) => (i % 3 === 0 ? -value : value));
}

function turned(triangles: Uint32Array): Uint32Array<ArrayBuffer> {
  return Uint32Array.from(triangles, (_, i) => triangles[i - (i % 3) + [0, 2, 1][i % 3]]);
}

/** Most of the surface has texture coordinates that turn the other way than its corners. */
function isTextureMirrored({ uv, triangles: drawn }: Photograph, triangles: Uint32Array): boolean {
  if (uv === null) return false;
  let [left, right] = [0, 0];
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [2 * drawn[t], 2 * drawn[t + 1], 2 * drawn[t + 2]];
    const area = (uv[b] - uv[a]) * (uv[c + 1] - uv[a + 1]) - (uv[c] - uv[a]) * (uv[b + 1] - uv[a + 1]);
    if (area > 0) left += area;
    else right -= area;
  }
  return right > left;
}

/** Each point of a registered photograph by the nearest point of the skin that faces the same way. */
export function bind(photograph: Photograph, triangles: Uint32Array, skin: Triangles): Pick<Registration, "bound" | "distancesMm"> {
  const { positions } = photograph;
  const count = positions.length / 3;
  const grid = new TriangleGrid(skin);
  const normals = vertexNormals(positions, triangles);
  const bound: BoundPhotograph = { ...photograph, places: new Uint32Array(3 * count), weights: new Float32Array(3 * count), offsetsMm: new Float32Array(count) };
  const distancesMm = new Float32Array(count).fill(FAR_MM);
  for (let v = 0; v < count; ++v) {
    const [x, y, z] = positions.subarray(3 * v, 3 * v + 3);
    const { triangle, distanceMm, weights } = grid.nearest(x, y, z, FAR_MM, normals.subarray(3 * v, 3 * v + 3));
    if (triangle < 0) continue;
    distancesMm[v] = distanceMm;
    const share = fade(distanceMm, FOLLOWING_MM, FAR_MM);
    const offset = [x, y, z];
    for (let corner = 0; corner < 3; ++corner) {
      const place = skin.triangles[3 * triangle + corner];
      bound.places[3 * v + corner] = place;
      bound.weights[3 * v + corner] = share * Math.max(0, weights[corner]);
      for (let k = 0; k < 3; ++k) offset[k] -= weights[corner] * skin.positions[3 * place + k];
    }
    const side = offset.reduce((sum, value, k) => sum + value * grid.normals[3 * triangle + k], 0);
    bound.offsetsMm[v] = side * fade(distanceMm, NEAR_MM, FADED_MM);
  }
  return { bound, distancesMm };
}

/** 1 up to `near`, 0 from `far`. */
function fade(value: number, near: number, far: number): number {
  return Math.min(1, Math.max(0, (far - value) / (far - near)));
}
