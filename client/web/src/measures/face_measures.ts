// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { create } from "@bufbuild/protobuf";
import type { CaseFile } from "../case/case_file";
import { type Measure, MeasureSchema } from "../generated/tissueform/v1/export_service_pb";
import { type Pose, movedPoint } from "../geometry/pose";
import { pointAt } from "../geometry/rigid_fit";
import { type Vector, subtract } from "../geometry/rotation";
import { type LandmarkMovement, isOnSkin, landmarkMovement } from "../planning/landmarks";
import { type Anchor, anchorNumber, anchorPoint } from "./anchor";
import { MEASURES } from "./definitions";
import { type MeasureResult, evaluate } from "./evaluation";
import { FACE_LANDMARKS } from "./face_landmarks";
import { faceFrame, hasHeadFrame, toFacePoint } from "./face_point";
import type { LandmarkBook } from "./landmark_book";
import { ownDefinition } from "./own_measures";
import { cutProfile, outline } from "./profile";
import { suggestFromProfile } from "./suggestions";

/** The face as it is shown, for who measures it. */
export interface ShownFace {
  readonly file: CaseFile;
  readonly landmarks: LandmarkBook;
  /** Of each of the case's surfaces where its vertices are, before its handle's pose. */
  positionsOf(surface: number): Float32Array;
  readonly shownPoses: ReadonlyMap<string, Pose>;
  /** Of each vertex of a surface, in mm; null where it is not known. */
  bandOf(surface: number): Float32Array | null;
  /** What is shown is the plan and nothing else. */
  readonly showsPlan: boolean;
}

/** Where an anchor is now, LPS. */
export function shownPoint(face: ShownFace, anchor: Anchor) {
  const { entry, triangles } = face.file.surfaces[anchor.surface];
  const point = anchorPoint({ positions: face.positionsOf(anchor.surface), triangles }, anchor);
  const pose = entry.handle === "" ? undefined : face.shownPoses.get(entry.handle);
  return pose === undefined ? point : movedPoint(pose, point);
}

/** How far the case's own landmarks are from rest, in the case's order. `bandMm`: null for bone, and where no band is known. */
export function landmarkMovements(face: ShownFace): (LandmarkMovement & { bandMm: number | null })[] {
  const { manifest, surfaces } = face.file;
  const skin = surfaces.findIndex(({ entry }) => entry.kind === "skin");
  const band = skin < 0 ? null : face.bandOf(skin);
  const skinMove = (vertex: number) => subtract(pointAt(face.positionsOf(skin), vertex), pointAt(surfaces[skin].positions, vertex));
  return manifest.landmarks.map((landmark) => ({
    ...landmarkMovement(landmark, face.shownPoses, skinMove, manifest.headFrame),
    bandMm: isOnSkin(landmark) ? (band?.[landmark.skinVertex as number] ?? null) : null,
  }));
}

/** All measures with what they are made of, as the face is shown. */
export function measureFace(face: ShownFace): MeasureResult[] {
  return measureAt(face, (_, anchor) => shownPoint(face, anchor));
}

/** The same where landmarks are at other places, LPS. */
export function measureAt(face: ShownFace, placeOf: (name: string, anchor: Anchor) => Vector): MeasureResult[] {
  const { surfaces } = face.file;
  const frame = faceFrame(face.file);
  const points = (at: (name: string, anchor: Anchor) => Vector) => new Map(Array.from(face.landmarks.placed, ([name, anchor]) => [name, toFacePoint(at(name, anchor), frame)]));
  const before = points((_, anchor) => anchorPoint(surfaces[anchor.surface], anchor));
  const after = points(placeOf);
  const own = face.landmarks.own.map((measure, index) => ownDefinition(measure, index, (name) => labelOf(face.landmarks, name)));
  const measured = { before, after, bandsMm: bandsMm(face), isMiddleKnown: hasHeadFrame(face.file) };
  return [...MEASURES, ...own].map((definition) => evaluate(definition, measured));
}

export function labelOf(book: LandmarkBook, name: string): string {
  return book.landmarks.find((landmark) => landmark.name === name)?.label ?? name;
}

/** Of each landmark; bone goes where it is put. Null where no band is known. */
export function bandsMm(face: ShownFace): Map<string, number> | null {
  const bands = new Map<string, number>();
  const ofSurfaces = new Map<number, Float32Array>();
  for (const [name, anchor] of face.landmarks.placed) {
    const surface = face.file.surfaces[anchor.surface];
    if (surface.entry.kind !== "skin") continue;
    const band = ofSurfaces.get(anchor.surface) ?? face.bandOf(anchor.surface);
    if (band === null) return null;
    ofSurfaces.set(anchor.surface, band);
    bands.set(name, anchorNumber(band, surface.triangles, anchor));
  }
  return bands.size === 0 ? null : bands;
}

/** Those that are known, for the PACS. */
export function toMessages(results: readonly MeasureResult[]): Measure[] {
  return results.flatMap((result) => {
    if (result.kind !== "value") return [];
    const { definition, before, after, band } = result;
    const interval = { lowestAfter: band?.lowest, highestAfter: band?.highest, intervalIsWhole: band?.parts !== undefined };
    return [create(MeasureSchema, { name: definition.name, title: clip(definition.title), unit: definition.unit, before, after, ...interval })];
  });
}

const MOST_TITLE_BYTES = 64;

function clip(title: string): string {
  let text = title;
  while (new TextEncoder().encode(text).length > MOST_TITLE_BYTES) text = text.slice(0, -1);
  return text;
}

/** What the case's landmarks and its profile at rest suggest; each lies on a surface, within 2 mm of what was found. */
export function suggestLandmarks(file: CaseFile, book: LandmarkBook): Map<string, Anchor> {
  const { landmarks } = file.manifest;
  const headFrame = faceFrame(file);
  const positions = new Map(landmarks.map(({ name, positionMm }) => [name, positionMm]));
  const known = new Map(Array.from(positions, ([name, point]) => [name, toFacePoint(point, headFrame)]));
  const skin = file.surfaces.find(({ entry }) => entry.kind === "skin");
  if (skin !== undefined) {
    const { originMm, posterior, superior } = headFrame;
    for (const [name, { forward, up }] of suggestFromProfile(outline(cutProfile(skin, headFrame)), known)) {
      const at = [0, 1, 2].map((k) => originMm[k] - forward * posterior[k] + up * superior[k]) as [number, number, number];
      if (!positions.has(name)) positions.set(name, at);
    }
  }
  for (const jaw of ["upper", "lower"]) {
    const incisor = positions.get(`${jaw}_incisor`);
    if (incisor !== undefined && !positions.has(`${jaw}_midline`)) positions.set(`${jaw}_midline`, incisor);
  }
  const found = new Map<string, Anchor>();
  for (const landmark of FACE_LANDMARKS) {
    const point = positions.get(landmark.name);
    const anchor = point === undefined ? null : book.nearest(landmark, point);
    if (anchor !== null) found.set(landmark.name, anchor);
  }
  return found;
}
