// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type Pose, movedPoint } from "../geometry/pose";
import { type Vector, subtract } from "../geometry/rotation";
import { isOnSkin, movementOf } from "../planning/landmarks";
import type { LandmarkEntry } from "../case/manifest";
import type { Anchor } from "./anchor";
import type { Band, BandParts } from "./evaluation";
import { type ShownFace, landmarkMovements } from "./face_measures";
import { type Place, type PlanAnswers, bandAround, doubtOf, placeOf } from "./whole_band";

const WAYS = ["forwardMm", "leftMm", "upMm", "totalMm"] as const;
type Way = (typeof WAYS)[number];

/** Of a landmark's movement the interval of each number in 95 of 100 cases: surgery, model and, where it is known, material. */
export type MovementBand = Record<Way, Band & { parts: BandParts }>;

/** Below this neither the plan nor what surgery misses moves a place: the table shows a dot. */
const LEAST_MM = 0.05;

/**
 * One for each of the case's landmarks, in their order; null for a landmark that neither the plan nor its deviations move: the
 * published errors of the model are of operated places. Null in all where the page cannot answer.
 */
export async function movementBands(face: ShownFace, answers: PlanAnswers): Promise<(MovementBand | null)[] | null> {
  const { landmarks, headFrame } = face.file.manifest;
  const movements = landmarkMovements(face);
  const places = new Map(landmarks.map((landmark, index) => [`${index}`, placeOfLandmark(face, landmark)]));
  const rest = landmarks.map((landmark) => restOf(face, landmark));
  const numbersAt = (at: (name: string) => Vector) => new Map(landmarks.flatMap((_, index) => {
    const movement = movementOf(subtract(at(`${index}`), rest[index]), headFrame);
    return WAYS.map((way): [string, number] => [`${index} ${way}`, movement[way]]);
  }));
  const doubts = await doubtOf(face.file, { places, numbersAt }, answers);
  if (doubts === null) return null;
  return movements.map(({ bandMm, ...movement }, index) => {
    const isMoved = movement.totalMm >= LEAST_MM || WAYS.some((way) => (doubts.get(`${index} ${way}`)?.surgery ?? 0) >= LEAST_MM);
    if (!isMoved) return null;
    const band = (way: Way) => bandAround(movement[way], { ...(doubts.get(`${index} ${way}`) as Omit<BandParts, "material">), material: bandMm });
    return { forwardMm: band("forwardMm"), leftMm: band("leftMm"), upMm: band("upMm"), totalMm: ofLength(band("totalMm")) };
  });
}

/** A length is at least 0. */
function ofLength<B extends Band>(band: B): B {
  return { ...band, lowest: Math.max(0, band.lowest) };
}

/** A landmark of the skin moves by its vertex (see landmarkMovement). */
function restOf({ file }: ShownFace, landmark: LandmarkEntry): Vector {
  const skin = skinOf(file.surfaces);
  if (!isOnSkin(landmark) || skin < 0) return landmark.positionMm;
  const at = 3 * (landmark.skinVertex as number);
  return [0, 1, 2].map((k) => file.surfaces[skin].positions[at + k]) as Vector;
}

function skinOf(surfaces: ShownFace["file"]["surfaces"]): number {
  return surfaces.findIndex(({ entry }) => entry.kind === "skin");
}

function placeOfLandmark(face: ShownFace, landmark: LandmarkEntry): Place {
  const skin = skinOf(face.file.surfaces);
  const anchor = isOnSkin(landmark) && skin >= 0 ? anchorAt(face, skin, landmark.skinVertex as number) : null;
  if (anchor !== null) return placeOf(face, anchor, landmark.name);
  const under = (poses: ReadonlyMap<string, Pose>): Vector => {
    const pose = poses.get(landmark.handle);
    return pose === undefined ? landmark.positionMm : movedPoint(pose, landmark.positionMm);
  };
  return { skin: null, shown: under(face.shownPoses), under };
}

/** A corner of one of the vertex's triangles; null where no triangle has the vertex. */
function anchorAt({ file }: ShownFace, surface: number, vertex: number): Anchor | null {
  const at = file.surfaces[surface].triangles.indexOf(vertex);
  if (at < 0) return null;
  return { surface, triangle: Math.floor(at / 3), weights: [0, 1, 2].map((k) => (k === at % 3 ? 1 : 0)) as Vector };
}
