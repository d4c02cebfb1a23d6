// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { CaseFile } from "../case/case_file";
import { type Pose, movedPoint } from "../geometry/pose";
import { type Vector, add, apply, cross, fromRotationVector, multiply, norm, scaled, subtract, toRotationVector } from "../geometry/rotation";
import { pointAt } from "../geometry/rigid_fit";
import { type Deviations, deviationsInUse, modelDeviation } from "./deviations";
import { type Anchor, anchorPoint, corners } from "./anchor";
import type { Band, BandParts, MeasureResult } from "./evaluation";
import { type ShownFace, measureAt, measureFace, shownPoint } from "./face_measures";

/** Of the normal distribution: 95 of 100 cases are within so many standard deviations. */
const NORMAL_95 = 1.96;
/** Measures are nearly linear over this part of a standard deviation, and positions of single precision still resolve it. */
const STEP = 0.1;
/** The front of a segment is the mean of this part of its vertices, the foremost ones. */
const FRONT_PART = 10;
const RADIANS = Math.PI / 180;

/** What is asked of who knows the plan's answers. */
export interface PlanAnswers {
  readonly handles: readonly { readonly name: string }[];
  /** Of the plan, one for each handle. */
  poses(): Pose[];
  /** Of each set of poses where points of the skin are, LPS; null where that is not known. */
  readonly skinPointsAt: (poseSets: readonly (readonly Pose[])[], anchors: readonly Anchor[]) => Promise<Vector[][] | null>;
}

/** A place of the face that numbers are made of. */
export interface Place {
  /** Bone lies where it is put: the model is in doubt for skin alone. */
  skin: { landmark: string; anchor: Anchor; normal: Vector } | null;
  /** As it is shown, LPS. */
  shown: Vector;
  /** Of bone, under other poses. */
  under(poses: ReadonlyMap<string, Pose>): Vector;
}

/** Numbers by name, of places that go by name. */
export interface PlacedNumbers {
  places: ReadonlyMap<string, Place>;
  numbersAt(at: (place: string) => Vector): ReadonlyMap<string, number>;
}

/**
 * Of each number half the intervals that surgery and the model alone cause in 95 of 100 cases, all deviations independent and in
 * first order. Null where the page cannot answer, and where the plan moves nothing: the pre-operative face is known.
 */
export async function doubtOf(file: CaseFile, numbers: PlacedNumbers, answers: PlanAnswers): Promise<Map<string, Omit<BandParts, "material">> | null> {
  const planned = answers.poses();
  if (planned.every(isAtRest)) return null;
  const shown = numbers.numbersAt((name) => placeNamed(numbers, name).shown);
  const deviations = await deviationsInUse();
  const [surgery, model]: Map<string, number>[] = [new Map(), new Map()];
  const addChange = (variances: Map<string, number>, from: ReadonlyMap<string, number>, to: ReadonlyMap<string, number>, perDeviation: number) => {
    for (const [name, after] of to) {
      const before = from.get(name);
      if (before !== undefined) variances.set(name, (variances.get(name) ?? 0) + ((after - before) * perDeviation) ** 2);
    }
  };
  // What is shown may be the server's full answer: differences are of answers of one kind.
  const [asPlanned, ...missed] = (await numbersUnder([planned, ...missedPoses(file, answers.handles, planned, deviations)], numbers, answers)) ?? [];
  if (asPlanned === undefined) return null;
  for (const missedBy of missed) addChange(surgery, asPlanned, missedBy, 1 / STEP);
  for (const [name, { skin, shown: place }] of numbers.places) {
    if (skin === null) continue;
    const shifted = add(place, scaled(skin.normal, STEP));
    const off = numbers.numbersAt((other) => (other === name ? shifted : placeNamed(numbers, other).shown));
    addChange(model, shown, off, modelDeviation(deviations, skin.landmark) / STEP);
  }
  const partOf = (variances: Map<string, number>, name: string) => NORMAL_95 * Math.sqrt(variances.get(name) ?? 0);
  return new Map(Array.from(shown.keys(), (name) => [name, { source: deviations.source, surgery: partOf(surgery, name), model: partOf(model, name) }]));
}

/** Under each set of poses; null where the page cannot answer. */
async function numbersUnder(poseSets: readonly (readonly Pose[])[], numbers: PlacedNumbers, { handles, skinPointsAt }: PlanAnswers): Promise<ReadonlyMap<string, number>[] | null> {
  const onSkin = Array.from(numbers.places).flatMap(([name, { skin }]) => (skin === null ? [] : [{ name, anchor: skin.anchor }]));
  const points = await skinPointsAt(poseSets, onSkin.map(({ anchor }) => anchor));
  if (points === null) return null;
  return poseSets.map((poses, set) => {
    const byHandle = new Map(handles.map(({ name }, index) => [name, poses[index]]));
    const skin = new Map(onSkin.map(({ name }, index) => [name, points[set][index]]));
    return numbers.numbersAt((name) => skin.get(name) ?? placeNamed(numbers, name).under(byHandle));
  });
}

function placeNamed({ places }: PlacedNumbers, name: string): Place {
  return places.get(name) as Place;
}

/**
 * Of each measure the interval in which it stays in 95 of 100 cases: surgery, model and material together. Where no band of the
 * material is known the interval is without it. Null where the page cannot answer.
 */
export async function wholeBands(face: ShownFace, answers: PlanAnswers): Promise<Map<string, Band> | null> {
  const places = new Map(Array.from(face.landmarks.placed, ([name, anchor]) => [name, placeOf(face, anchor, name)]));
  const numbersAt = (at: (name: string) => Vector) => new Map(measureAt(face, at).flatMap((result): [string, number][] => (result.kind === "value" ? [[result.definition.name, result.after]] : [])));
  // Before the answers come: the face may change.
  const results = measureFace(face);
  const doubts = await doubtOf(face.file, { places, numbersAt }, answers);
  if (doubts === null) return null;
  return new Map(results.flatMap((result): [string, Band][] => {
    const doubt = doubts.get(result.definition.name);
    if (result.kind !== "value" || doubt === undefined) return [];
    return [[result.definition.name, bandAround(result.after, { ...doubt, material: ofMaterial(result) })]];
  }));
}

/** A segment that the plan leaves in place is taken as not operated on. */
function isAtRest({ rotationVector, translationMm, scale }: Pose): boolean {
  return norm(rotationVector) === 0 && norm(translationMm) === 0 && scale === 1;
}

/** The parts are independent. */
export function bandAround(after: number, parts: BandParts): Band & { parts: BandParts } {
  const half = Math.hypot(parts.surgery, parts.model, parts.material ?? 0);
  return { lowest: after - half, highest: after + half, parts };
}

/** Half the interval of the material alone. */
function ofMaterial(result: MeasureResult): number | null {
  if (result.kind !== "value" || result.band === null) return null;
  return (result.band.highest - result.band.lowest) / 2;
}

/** An anchor as a place. */
export function placeOf(face: ShownFace, anchor: Anchor, landmark: string): Place {
  return {
    skin: face.file.surfaces[anchor.surface].entry.kind === "skin" ? { landmark, anchor, normal: normalAt(face, anchor) } : null,
    shown: shownPoint(face, anchor),
    under: (poses) => boneUnder(face, anchor, poses),
  };
}

/** Each with one moved segment a part of a standard deviation off its pose, in one of six ways. */
function* missedPoses(file: CaseFile, handles: PlanAnswers["handles"], planned: readonly Pose[], { translationMm, rotationDeg }: Deviations): Generator<Pose[]> {
  for (const [index, { name }] of handles.entries()) {
    if (isAtRest(planned[index])) continue;
    const front = movedPoint(planned[index], frontOf(file, name));
    for (const axis of [0, 1, 2]) {
      const along = [0, 0, 0].map((_, k) => (k === axis ? 1 : 0)) as Vector;
      const shift = scaled(along, STEP * translationMm[axis]);
      const turn = scaled(along, STEP * rotationDeg[axis] * RADIANS);
      yield planned.map((pose, other) => (other === index ? missed(pose, front, [0, 0, 0], shift) : pose));
      yield planned.map((pose, other) => (other === index ? missed(pose, front, turn, [0, 0, 0]) : pose));
    }
  }
}

/** `pose`, and then a small turn about `place` and a shift. */
function missed(pose: Pose, place: Vector, turn: Vector, shift: Vector): Pose {
  const rotation = fromRotationVector(turn);
  const movedPivot = add(pose.pivotMm, pose.translationMm);
  const goal = add(add(place, apply(rotation, subtract(movedPivot, place))), shift);
  return { ...pose, rotationVector: toRotationVector(multiply(rotation, fromRotationVector(pose.rotationVector))), translationMm: subtract(goal, pose.pivotMm) };
}

const fronts = new WeakMap<CaseFile, Map<string, Vector>>();

/** The front of a segment at rest, LPS: where its teeth are. */
function frontOf(file: CaseFile, handle: string): Vector {
  const known = fronts.get(file) ?? new Map<string, Vector>();
  fronts.set(file, known);
  const front = known.get(handle) ?? findFront(file, handle);
  known.set(handle, front);
  return front;
}

function findFront(file: CaseFile, handle: string): Vector {
  const points = file.surfaces.filter(({ entry }) => entry.handle === handle).flatMap(({ positions }) => Array.from({ length: positions.length / 3 }, (_, vertex) => pointAt(positions, vertex)));
  points.sort((a, b) => a[1] - b[1]);
  const front = points.slice(0, Math.max(1, Math.floor(points.length / FRONT_PART)));
  return scaled(front.reduce(add, [0, 0, 0]), 1 / Math.max(1, front.length));
}

function boneUnder({ file }: ShownFace, anchor: Anchor, poses: ReadonlyMap<string, Pose>): Vector {
  const { entry, ...shape } = file.surfaces[anchor.surface];
  const point = anchorPoint(shape, anchor);
  const pose = poses.get(entry.handle);
  return pose === undefined ? point : movedPoint(pose, point);
}

function normalAt(face: ShownFace, anchor: Anchor): Vector {
  const [a, b, c] = corners({ positions: face.positionsOf(anchor.surface), triangles: face.file.surfaces[anchor.surface].triangles }, anchor.triangle);
  const normal = cross(subtract(b, a), subtract(c, a));
  return scaled(normal, 1 / Math.max(norm(normal), Number.MIN_VALUE));
}
