// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type AnswerSizes, sizesOf } from "./answer_sizes";
import { type AnswerNumbers, AnswerModel, FIXED, FREE, type PackedColumns, type PreparedColumns } from "./prepared_columns";

const MOST_OF_ANYTHING = 2 ** 28;
const MOST_HANDLES = 10_000;
const MOST_DEGREE = 1000;
/** 16 tissues and Poisson's ratio. */
const MOST_BAND_VARIABLES = 17;

/** What is wrong with answers that come from outside, one line; "" when nothing is: sizes fit, numbers are finite, indices are indices. */
export function checkAnswers(answers: PreparedColumns): string {
  if (!numbersAreInRange(answers.numbers)) return "a number of the prepared answers is out of range";
  if (!allAreFinite(answers)) return "a value of the prepared answers is not finite";
  if (!verticesFit(answers)) return "regions and rest positions do not fit together";
  if (answers.version < 2 && answers.thirdLengths.length > 0) return "a section belongs to a later version";
  const { model } = answers.numbers;
  const sizes = sizesOf(answers);
  if (!bandFits(answers, sizes)) return "the band's sizes do not fit";
  if (!hasNothingElse(answers)) return "a section belongs to another model";
  if (model === AnswerModel.GRADIENT_FIELD && !expansionFits(answers, sizes)) return "the expansion's sizes do not fit";
  if (model === AnswerModel.NEO_HOOKEAN) {
    if (!seriesFits(answers, sizes)) return "the series' sizes do not fit";
    return clustersFit(answers, sizes) ? "" : "the clusters' sizes do not fit";
  }
  if (model === AnswerModel.LINEAR_ELASTIC && answers.origins.length !== 3) return "there is no origin of the columns";
  return compressionFits(answers, sizes) ? "" : "the columns' sizes do not fit";
}

function isCount(value: number, least: number, most: number): boolean {
  return Number.isInteger(value) && value >= least && value <= most;
}

function numbersAreInRange(numbers: AnswerNumbers): boolean {
  return (
    Object.values(numbers).every((value: number) => Number.isFinite(value) && value >= 0) &&
    isCount(numbers.model, 1, 3) &&
    isCount(numbers.vertices, 1, MOST_OF_ANYTHING) &&
    isCount(numbers.handles, 1, MOST_HANDLES) &&
    isCount(numbers.polynomials, 0, MOST_OF_ANYTHING) &&
    isCount(numbers.degree, 0, MOST_DEGREE) &&
    numbers.toleranceMm > 0
  );
}

function allAreFinite(answers: PreparedColumns): boolean {
  const lists = Object.values({ ...answers, steps: answers.columns.steps, bandSteps: answers.band.steps, mapSteps: answers.clusterMap.steps });
  return lists.every((list) => {
    if (!(list instanceof Float64Array || list instanceof Float32Array)) return true;
    // Sums of finite numbers may overflow, but one that is not finite times 0 is never 0.
    let sum = 0;
    for (let i = 0; i < list.length; ++i) sum += list[i] * 0;
    return sum === 0;
  });
}

function verticesFit({ numbers, regions, freeRest, fixedRest, handleRest }: PreparedColumns): boolean {
  let free = 0;
  let fixed = 0;
  for (const region of regions) {
    if (region < FREE || region >= numbers.handles) return false;
    if (region === FREE) free += 1;
    if (region === FIXED) fixed += 1;
  }
  return (
    regions.length === numbers.vertices &&
    freeRest.length === 3 * free &&
    fixedRest.length === 3 * fixed &&
    handleRest.length === 3 * (regions.length - free - fixed)
  );
}

/** What one model has and another has not. */
function hasNothingElse(answers: PreparedColumns): boolean {
  const isEmpty = (...lists: ArrayLike<number>[]) => lists.every((list) => list.length === 0);
  const { model } = answers.numbers;
  const noExpansion = isEmpty(answers.nodes, answers.interpolation, answers.simplexLow, answers.guardGains);
  const noCompression = isEmpty(answers.map, answers.gains, answers.cutMap, answers.tail);
  const noClusters =
    isEmpty(answers.centroids, answers.clusters, answers.clusterVertices, answers.firstGains, answers.secondGains, answers.probes) &&
    isEmpty(answers.secondLengths, answers.thirdLengths, answers.thirdGains) &&
    isPacked(answers.clusterMap, 0, 0);
  return (model === AnswerModel.GRADIENT_FIELD || noExpansion) && (model === AnswerModel.NEO_HOOKEAN ? noCompression : noClusters);
}

/** `rows` by `columns`, with lower halves of some columns. */
function isPacked(packed: PackedColumns, rows: number, columns: number): boolean {
  return (
    packed.steps.length === columns &&
    packed.upper.length === rows * columns &&
    packed.lower.length <= packed.upper.length &&
    (rows === 0 || packed.lower.length % rows === 0)
  );
}

/** How many polynomials of so many variables there are up to a degree; too many where that is beyond all bounds. */
function countPolynomials(dimension: number, degree: number): number {
  let count = 1;
  for (let i = 1; i <= degree && count < MOST_OF_ANYTHING; ++i) count *= (dimension + i) / i;
  return Math.round(count);
}

function expansionFits(answers: PreparedColumns, sizes: AnswerSizes): boolean {
  const { numbers } = answers;
  const { handles, degree } = numbers;
  return (
    degree >= 2 &&
    sizes.nodes === countPolynomials(handles, degree) &&
    numbers.polynomials + answers.guardGains.length === countPolynomials(handles, degree - 1) &&
    numbers.polynomials === countPolynomials(handles, degree - 2) &&
    numbers.simplexWidth > 0 &&
    answers.origins.length === 3 * handles &&
    answers.nodes.length === sizes.nodes * handles &&
    answers.interpolation.length === sizes.nodes * sizes.nodes &&
    answers.simplexLow.length === handles
  );
}

/** Only where there are columns of elasticity. */
function bandFits({ numbers, band, bandMap }: PreparedColumns, { free, bandVariables }: AnswerSizes): boolean {
  if (band.steps.length === 0) return bandMap.length === 0 && band.upper.length === 0;
  return (
    numbers.model !== AnswerModel.GRADIENT_FIELD &&
    bandMap.length === 12 * numbers.handles * band.steps.length &&
    bandVariables <= MOST_BAND_VARIABLES &&
    (free === 0 || bandVariables > 0) &&
    isPacked(band, 3 * free * bandVariables, band.steps.length)
  );
}

function compressionFits(answers: PreparedColumns, sizes: AnswerSizes): boolean {
  return (
    answers.tail.length === sizes.factors &&
    answers.gains.length === sizes.columns &&
    answers.map.length === sizes.columns * sizes.factors &&
    answers.cutMap.length % sizes.factors === 0 &&
    isPacked(answers.columns, sizes.rows, sizes.columns)
  );
}

function seriesFits(answers: PreparedColumns, sizes: AnswerSizes): boolean {
  const { handles, sizeMm } = answers.numbers;
  return (
    answers.origins.length === 3 &&
    answers.centroids.length === 3 * handles &&
    answers.firstGains.length === 6 * handles &&
    sizeMm > 0 &&
    answers.secondGains.length === sizes.pairs &&
    answers.probes.length % (3 * sizes.pairs) === 0 &&
    thirdOrderFits(answers, sizes)
  );
}

/** All of it or nothing. */
function thirdOrderFits(answers: PreparedColumns, sizes: AnswerSizes): boolean {
  if (sizes.triples === 0) return answers.secondLengths.length === 0 && answers.thirdGains.length === 0;
  return (
    answers.secondLengths.length % sizes.pairs === 0 &&
    answers.thirdLengths.length % sizes.triples === 0 &&
    answers.thirdGains.length === sizes.triples
  );
}

function clustersFit(answers: PreparedColumns, sizes: AnswerSizes): boolean {
  const { clusters, clusterVertices } = answers;
  let [vertices, columns, upper, lower] = [0, 0, 0, 0];
  if (clusters.length % 3 !== 0) return false;
  for (let k = 0; k < clusters.length; k += 3) {
    const [ofVertices, ofColumns, full] = clusters.subarray(k, k + 3);
    if (ofVertices < 0 || full < 0 || ofColumns < full) return false;
    vertices += ofVertices;
    columns += ofColumns;
    upper += 3 * ofVertices * ofColumns;
    lower += 3 * ofVertices * full;
    if (vertices > sizes.free || columns > sizes.columns) return false;
  }
  const seen = new Uint8Array(sizes.free);
  for (const vertex of clusterVertices) {
    if (vertex < 0 || vertex >= sizes.free || seen[vertex] === 1) return false;
    seen[vertex] = 1;
  }
  return (
    vertices === sizes.free &&
    clusterVertices.length === sizes.free &&
    columns === sizes.columns &&
    answers.columns.upper.length === upper &&
    answers.columns.lower.length === lower &&
    isPacked(answers.clusterMap, sizes.columns, sizes.factors)
  );
}
