// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { messageOf } from "../calls/call_error";
import type { CaseFile } from "../case/case_file";
import { type LargestMovement, largestMovement, largestOf } from "../geometry/largest_movement";
import type { Penetration } from "../geometry/penetration";
import type { Pose } from "../geometry/pose";
import type { Band } from "../measures/evaluation";
import type { ShownFace } from "../measures/face_measures";
import type { LandmarkBook } from "../measures/landmark_book";
import { type MovementBand, movementBands } from "../measures/movement_bands";
import { wholeBands } from "../measures/whole_band";
import type { Plan } from "../planning/plan";
import { Head } from "../scene/head";
import type { Shape } from "../workbench/comparison";
import { FaceColors } from "../workbench/face_colors";
import { describeAnswer } from "../workbench/shown_answer";
import { Signal } from "../workbench/signal";
import type { Workbench } from "../workbench/workbench";

/** What of the workbench answers a plan: the model, the session and the page's own answers are those of the planner. */
export type PlanAnswerer = Pick<Workbench, "file" | "landmarks" | "shapeAt" | "planAnswers" | "penetrationsAt" | "posesByHandle" | "modelInfo"> & {
  readonly answers: Pick<Workbench["answers"], "solve">;
  readonly live: Pick<Workbench["live"], "session">;
  readonly model: Pick<Workbench["model"], "value">;
};

/** The hand rests: what takes longer than a picture is done now. */
const REST_MS = 300;
/** Its prepared answers are estimates, which the full answer replaces. */
const ESTIMATED = "neo_hookean";

/** A plan of the comparison with the face that answers its movements. */
export class ComparedPlan implements ShownFace {
  readonly file: CaseFile;
  readonly landmarks: LandmarkBook;
  readonly showsPlan = true;
  readonly head: Head;
  readonly colors: FaceColors;
  readonly penetrations = new Signal<Penetration[]>([]);
  shownPoses: ReadonlyMap<string, Pose> = new Map();
  /** Of `wholeBands`; null while the hand moves, and where they are not known. */
  bands: ReadonlyMap<string, Band> | null = null;
  /** Of `movementBands`, likewise. */
  movementBands: readonly (MovementBand | null)[] | null = null;
  /** About the face: how good it is, or why it is missing. */
  status = "";
  /** The face is the answer to the plan's movements; else it is still that of earlier ones. */
  isAnswered = false;

  /** The server gave no answer to the newest question. */
  hasFailed = false;

  private shape: Shape;
  private isActive = false;
  private isFollowing = false;
  private isFull = false;
  /** How often was asked: an answer to an older question is not shown. */
  private asked = 0;
  private resting: ReturnType<typeof setTimeout> | undefined;

  /** `onShown`: the face, its numbers or its status changed. */
  constructor(
    private readonly bench: PlanAnswerer,
    readonly plan: Plan,
    readonly letter: string,
    public name: string,
    private readonly onShown: () => void,
  ) {
    this.file = bench.file;
    this.landmarks = bench.landmarks;
    this.head = new Head(bench.file);
    this.colors = new FaceColors(this.head);
    this.shape = { displacements: new Float32Array(3 * bench.file.followed.length), uncertainty: null, poses: plan.restPoses() };
    plan.onChange(() => this.ask());
  }

  /** "B: Chin up" */
  get label(): string {
    return `${this.letter}: ${this.name}`;
  }

  /** Three of each of CaseFile.followed, mm. */
  get displacements(): Float32Array {
    return this.shape.displacements;
  }

  get uncertainty(): Float32Array | null {
    return this.shape.uncertainty;
  }

  positionsOf(surface: number): Float32Array {
    return this.head.surfaces[surface].shape.positions;
  }

  bandOf(surface: number): Float32Array | null {
    if (this.uncertainty === null) return null;
    const { shape } = this.head.surfaces[surface];
    const band = new Float32Array(shape.positions.length / 3);
    shape.spread(this.uncertainty, band);
    return band;
  }

  largest(): LargestMovement {
    const spread = (to: (out: Float32Array) => void, count: number) => {
      const out = new Float32Array(count);
      to(out);
      return out;
    };
    return largestOf(
      this.head.skins.map(({ shape, source }) => {
        const count = source.positions.length / 3;
        const lengths = spread((out) => shape.spreadLengths(this.displacements, out), count);
        const { uncertainty } = this;
        return largestMovement(lengths, uncertainty && spread((out) => shape.spread(uncertainty, out), count));
      }),
    );
  }

  /** A hidden plan asks nothing. */
  setActive(isActive: boolean): void {
    this.isActive = isActive;
    this.ask();
  }

  /** The face of the plan's movements: the page's own answer at once, where it has one, else the server's when the hand rests. */
  ask(): void {
    this.asked += 1;
    clearTimeout(this.resting);
    if (!this.isActive) return;
    [this.isAnswered, this.hasFailed, this.bands, this.movementBands, this.status] = [false, false, null, null, "Waiting for the answer …"];
    this.shownPoses = this.bench.posesByHandle(this.plan.poses());
    this.head.setPoses(this.shownPoses);
    this.onShown();
    void this.follow();
  }

  /** One question at a time: of those that come in between only the newest is asked. */
  private async follow(): Promise<void> {
    if (this.isFollowing) return;
    this.isFollowing = true;
    for (let asked = -1; asked !== this.asked; ) {
      asked = this.asked;
      const shape = await this.bench.shapeAt(this.plan.poses());
      if (shape !== null && asked === this.asked) this.lay(shape, this.isEstimate);
    }
    this.isFollowing = false;
    this.resting = setTimeout(() => void this.settle(), REST_MS);
  }

  private get isEstimate(): boolean {
    return this.bench.modelInfo(this.bench.model.value)?.name === ESTIMATED;
  }

  private lay(shape: Shape, isEstimate: boolean): void {
    this.show(shape, isEstimate ? "Estimate; the full answer follows." : "Prepared answer.");
    this.isFull = !isEstimate;
  }

  private show(shape: Shape, status: string): void {
    this.shape = shape;
    this.head.setDisplacements(shape.displacements);
    [this.isAnswered, this.status] = [true, status];
    this.onShown();
  }

  private async settle(): Promise<void> {
    const { asked } = this;
    const isOver = () => asked !== this.asked || !this.isActive;
    if (isOver()) return;
    const poses = this.plan.poses();
    try {
      if (!this.isAnswered || !this.isFull) await this.solve(poses, isOver);
      if (isOver()) return;
      this.penetrations.value = this.bench.penetrationsAt(poses);
      const answers = { handles: this.plan.handles, poses: () => poses, skinPointsAt: this.bench.planAnswers.skinPointsAt };
      const bands = await wholeBands(this, answers);
      const movements = await movementBands(this, answers);
      if (!isOver()) [this.bands, this.movementBands] = [bands, movements];
    } catch (thrown) {
      if (isOver()) return;
      this.hasFailed = true;
      this.status = `${this.isAnswered ? "Estimate without a full answer" : "Not answered"}: ${messageOf(thrown)}`;
    }
    if (!isOver()) this.onShown();
  }

  /** By the server. What it refines has the band of the same poses. */
  private async solve(poses: Pose[], isOver: () => boolean): Promise<void> {
    const { displacements, summary } = await this.bench.answers.solve(this.bench.live.session, this.bench.model.value, poses);
    if (isOver()) return;
    const uncertainty = this.isAnswered ? this.uncertainty : null;
    this.show({ displacements, uncertainty, poses }, summary === null ? "" : describeAnswer({ by: "server", summary, isRefining: false }));
    this.isFull = true;
  }
}
