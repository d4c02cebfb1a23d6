// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Evaluation } from "../evaluation/answer_evaluator";
import type { DeformFrame } from "../generated/tissueform/v1/deform_service_pb";
import type { DisplayedFrame } from "../live/drag_session";
import { subtractInto } from "./face_colors";
import type { ShownAnswer } from "./shown_answer";

/** What the plan's face is: the newest answer to its poses, the page's own or the server's, with the band of that answer and whose it is. */
export class NewestAnswer {
  /** Three of each of CaseFile.followed, mm; the same array always. */
  readonly displacements: Float32Array;
  private readonly ownBand: Float32Array;
  private bandMm: Float32Array | null = null;
  private taken: ShownAnswer | null = null;

  /** `rest`: of CaseFile.followed. */
  constructor(private readonly rest: Float32Array) {
    this.displacements = new Float32Array(rest.length);
    this.ownBand = new Float32Array(rest.length / 3);
  }

  /** Of each of CaseFile.followed, mm; null where the answer has none. */
  get uncertainty(): Float32Array | null {
    return this.bandMm;
  }

  /** Null: none was taken yet, or it says nothing of itself. */
  get answer(): ShownAnswer | null {
    return this.taken;
  }

  /**
   * The server's. `posesSinceOwn`: how many poses the hand has sent since the one that the page itself has answered: the face never
   * goes back to older ones. Returns whether it was taken.
   */
  takePicture(picture: Pick<DisplayedFrame, "positions" | "uncertainty" | "posesBehind"> & { frame: Pick<DeformFrame, "refinement" | "refining" | "summary"> }, posesSinceOwn: number): boolean {
    if (picture.positions.length !== this.rest.length) throw new Error("a frame has other vertices than the case");
    if (picture.posesBehind > posesSinceOwn) return false;
    subtractInto(picture.positions, this.rest, this.displacements);
    // What refines an answer comes without a band: it is still that of the same poses.
    if (picture.frame.refinement === 0) this.bandMm = picture.uncertainty;
    const { summary, refining } = picture.frame;
    this.taken = summary === undefined ? null : { by: "server", summary, isRefining: refining };
    return true;
  }

  /** Of the newest answer, where it came later. */
  takeBand(bandMm: Float32Array): void {
    this.bandMm = bandMm;
  }

  /** The page's own. Returns whether it was taken: not if it is of other vertices. */
  takeOwn({ positions, uncertainty, errorBoundMm, isEstimate }: Omit<Evaluation, "coverage">): boolean {
    if (positions.length !== this.rest.length) return false;
    subtractInto(positions, this.rest, this.displacements);
    // Copied: the evaluator reuses its own array for the next evaluation.
    if (uncertainty !== null) this.ownBand.set(uncertainty);
    this.bandMm = uncertainty === null ? null : this.ownBand;
    this.taken = { by: "page", errorBoundMm, isEstimate };
    return true;
  }
}
