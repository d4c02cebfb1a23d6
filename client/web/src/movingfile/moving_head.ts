// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { CaseSurface } from "../case/case_file";
import { type LargestMovement, largestMovement, largestOf } from "../geometry/largest_movement";
import type { Pose } from "../geometry/pose";
import type { MovingData } from "../movingdata/moving_data";
import { DrawnPhotograph } from "../photograph/drawn_photograph";
import { Plan, type PlannedCase, posesOfCase } from "../planning/plan";
import type { DrawnCase } from "../scene/head";
import { HeadView } from "../scene/head_view";
import type { StageListener } from "../scene/stage";
import { FaceColors, type MapLegend, subtractInto } from "../workbench/face_colors";
import type { Answer } from "./answer_engine";
import type { Engine } from "./engine";
import { NewestPoses } from "./newest_poses";

/** What is seen, in numbers. */
export interface Shown extends LargestMovement {
  errorBoundMm: number;
  isEstimate: boolean;
  legend: MapLegend | null;
}

/** Why the picture is still the one before: the poses reach further than the answers, or there is no answer. */
export type NotShown = "beyond" | "failed";

/** The head that moves: a plan, what answers it, and the picture. */
export class MovingHead {
  readonly plan: Plan;
  readonly view: HeadView;
  /** Pictures shown so far. */
  answered = 0;
  /** Null where the file has none. */
  photograph: DrawnPhotograph | null = null;
  onShown: (shown: Shown | NotShown) => void = () => {};

  private readonly colors: FaceColors;
  private readonly planned: ReadonlyMap<string, Pose>;
  private readonly displacements: Float32Array;
  private readonly lengths: Float32Array[];
  private readonly bands: Float32Array[];
  private readonly newest: NewestPoses;
  private isColored = false;

  private constructor(
    container: HTMLElement,
    readonly data: MovingData,
    private readonly engine: Engine,
    private readonly rest: Float32Array,
    listener: StageListener,
  ) {
    const drawn: DrawnCase & PlannedCase = { manifest: data, surfaces: data.surfaces.map(toCaseSurface) };
    this.plan = new Plan(drawn);
    this.planned = posesOfCase(drawn);
    this.view = new HeadView(container, drawn, listener);
    this.colors = new FaceColors(this.view.head);
    this.displacements = new Float32Array(rest.length);
    const { skins } = this.view.head;
    this.lengths = skins.map(({ source }) => new Float32Array(source.positions.length / 3));
    this.bands = skins.map(({ source }) => new Float32Array(source.positions.length / 3));
    this.newest = new NewestPoses(engine, { onAnswer: (poses, answer) => this.show(poses, answer), onFailed: (thrown) => this.fail(thrown) });
    this.plan.onChange(() => this.follow());
  }

  /** Throws an Error where the answers are of other vertices than the surfaces follow. */
  static async make(container: HTMLElement, data: MovingData, engine: Engine, listener: StageListener): Promise<MovingHead> {
    const atRest = await engine.ask(data.handles.map(({ pivotMm }) => ({ rotationVector: [0, 0, 0], pivotMm, translationMm: [0, 0, 0], scale: 1 })));
    const count = atRest === null ? 0 : atRest.positions.length / 3;
    const isWithin = data.surfaces.every(({ follows }) => follows === null || follows.places.every((place) => place < count));
    if (atRest === null || !isWithin) throw new Error("the answers belong to another head than the surfaces");
    const head = new MovingHead(container, data, engine, Float32Array.from(atRest.positions), listener);
    if (data.photograph !== null) head.photograph = await DrawnPhotograph.make(head.view.head, data.photograph);
    head.showShare(1);
    return head;
  }

  get isInWorker(): boolean {
    return this.engine.isInWorker;
  }

  /** The picture is that of the newest poses. */
  get isIdle(): boolean {
    return this.newest.isIdle;
  }

  /** 0: before, all at rest; 1: as the plan has it. Segments without sliders stay as the plan has them. */
  showShare(share: number): void {
    const before = this.plan.restPoses();
    const poses = this.data.handles.map((handle, index) => {
      const planned = this.planned.get(handle.name) ?? before[index];
      return [handle.name, this.plan.poseBetween(index, before[index], planned, share)] as const;
    });
    this.plan.setPoses(new Map(poses));
  }

  setColored(isColored: boolean): void {
    this.isColored = isColored;
    this.photograph?.setHidden(isColored);
    this.follow();
  }

  private follow(): void {
    void this.newest.ask(this.plan.poses());
  }

  private fail(thrown: unknown): void {
    console.error(thrown);
    this.onShown("failed");
  }

  private show(poses: Pose[], answer: Answer | null): void {
    this.answered += 1;
    if (answer === null) return this.onShown("beyond");
    const { head } = this.view;
    subtractInto(answer.positions, this.rest, this.displacements);
    head.setDisplacements(this.displacements);
    this.photograph?.follow();
    this.view.setPoses(new Map(this.data.handles.map(({ name }, index) => [name, poses[index]])));
    let legend: MapLegend | null = null;
    if (this.isColored) legend = this.colors.showLengths("Movement of the skin", this.displacements);
    else this.colors.clear();
    this.onShown({ ...this.largest(answer), errorBoundMm: answer.errorBoundMm, isEstimate: answer.isEstimate, legend });
  }

  private largest({ uncertainty }: Answer): LargestMovement {
    const ofSkins = this.view.head.skins.map(({ shape }, s) => {
      shape.spreadLengths(this.displacements, this.lengths[s]);
      if (uncertainty !== null) shape.spread(uncertainty, this.bands[s]);
      return largestMovement(this.lengths[s], uncertainty === null ? null : this.bands[s]);
    });
    return largestOf(ofSkins);
  }
}

function toCaseSurface({ name, kind, handle, positions, triangles, follows }: MovingData["surfaces"][number]): CaseSurface {
  return { entry: { name, kind, handle, mesh: 0, follows: null, regions: null }, positions, triangles, follows, regions: null };
}
