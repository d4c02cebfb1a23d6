// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { CaseFile } from "../case/case_file";
import type { Measure } from "../generated/tissueform/v1/export_service_pb";
import type { Prediction } from "../generated/tissueform/v1/prediction_pb";
import { FollowingSurface } from "../geometry/following_surface";
import type { Pose } from "../geometry/pose";
import { type ShownFace, toMessages } from "../measures/face_measures";
import type { LandmarkBook } from "../measures/landmark_book";
import { measureAtRest } from "../measures/rest_measures";
import type { PlanAnswers } from "../measures/whole_band";
import type { Comparer, Shape } from "./comparison";

/** What the page knows of a stored prediction, and who answers for it. */
export interface StoredFace {
  file: CaseFile;
  landmarks: LandmarkBook;
  comparer: Pick<Comparer, "between">;
  /** What the plan shows, which may be something else. */
  planned: Shape;
  answers: PlanAnswers;
}

/** The numbers of a stored prediction's face, independent of what is on the stage. Rejects with a CallError. */
export async function storedMeasures({ file, landmarks, comparer, planned, answers }: StoredFace, prediction: Prediction): Promise<Measure[]> {
  const shape = await comparer.between({ from: "rest", to: prediction, share: 1 }, planned);
  const ofShape = { handles: answers.handles, poses: () => shape.poses, skinPointsAt: answers.skinPointsAt };
  return toMessages(await measureAtRest(new FaceOfShape(file, landmarks, shape), ofShape));
}

/** A face that is not shown. */
class FaceOfShape implements ShownFace {
  readonly shownPoses: ReadonlyMap<string, Pose>;
  /** There is no other plan beside its poses. */
  readonly showsPlan = true;
  /** Those that were requested. */
  private readonly surfaces = new Map<number, FollowingSurface>();

  constructor(
    readonly file: CaseFile,
    readonly landmarks: LandmarkBook,
    private readonly shape: Shape,
  ) {
    this.shownPoses = new Map(file.manifest.handles.map(({ name }, index) => [name, shape.poses[index]]));
  }

  positionsOf(surface: number): Float32Array {
    return this.surface(surface).positions;
  }

  bandOf(surface: number): Float32Array | null {
    const { uncertainty } = this.shape;
    if (uncertainty === null) return null;
    const band = new Float32Array(this.file.surfaces[surface].positions.length / 3);
    this.surface(surface).spread(uncertainty, band);
    return band;
  }

  private surface(index: number): FollowingSurface {
    const known = this.surfaces.get(index);
    if (known !== undefined) return known;
    const { positions, triangles, follows } = this.file.surfaces[index];
    const made = new FollowingSurface(positions, triangles, follows);
    if (follows !== null) made.move(this.shape.displacements);
    this.surfaces.set(index, made);
    return made;
  }
}
