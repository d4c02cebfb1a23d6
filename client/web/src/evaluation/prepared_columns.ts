// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

// What prepared answers hold (docs/prepared-answers.md), however it was read.

export enum AnswerModel {
  GRADIENT_FIELD = 1,
  LINEAR_ELASTIC = 2,
  NEO_HOOKEAN = 3,
}

export const FIXED = -1;
export const FREE = -2;

/** Section 1; what another model has is 0. Lengths in mm, angles in rad. */
export interface AnswerNumbers {
  model: AnswerModel;
  vertices: number;
  handles: number;
  toleranceMm: number;
  maxRotation: number;
  maxScaleChange: number;
  maxEstimateMm: number;
  largestRestMm: number;
  polynomials: number;
  degree: number;
  simplexWidth: number;
  largestGainMm: number;
  sizeMm: number;
  estimateScale: number;
  cutPerMm: number;
  roundingMm: number;
}

/** Column-major fixed-point numbers: (65536 upper + lower) step; the last columns have lower halves. */
export interface PackedColumns {
  steps: Float64Array;
  upper: Int16Array;
  lower: Int16Array;
}

/** All sections by name, empty if the bytes have no sections. They are views of the bytes that were read: both stay unchanged. */
export interface PreparedColumns {
  version: number;
  numbers: AnswerNumbers;
  regions: Int32Array;
  freeRest: Float32Array;
  fixedRest: Float32Array;
  handleRest: Float64Array;
  origins: Float64Array;
  centroids: Float64Array;
  nodes: Float64Array;
  interpolation: Float64Array;
  simplexLow: Float64Array;
  guardGains: Float64Array;
  map: Float64Array;
  gains: Float64Array;
  cutMap: Float32Array;
  tail: Float32Array;
  columns: PackedColumns;
  clusterMap: PackedColumns;
  clusters: Int32Array;
  clusterVertices: Int32Array;
  firstGains: Float64Array;
  secondGains: Float64Array;
  probes: Float32Array;
  secondLengths: Float32Array;
  thirdLengths: Float32Array;
  thirdGains: Float64Array;
  bandMap: Float64Array;
  band: PackedColumns;
}
