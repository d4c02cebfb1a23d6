// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { CaseSurface } from "../case/case_file";
import type { Pose } from "../geometry/pose";
import type { MovingData } from "../movingdata/moving_data";
import { Plan, type PlannedCase, posesOfCase } from "../planning/plan";
import type { DrawnCase } from "../scene/head";
import { HeadView } from "../scene/head_view";
import type { StageListener } from "../scene/stage";
import { FaceColors, type MapLegend, subtractInto } from "../workbench/face_colors";
import type { Answer } from "./answer_engine";
import type { Engine } from "./engine";

/** What is seen, in numbers. */
export interface Shown {
  /** The poses reach further than the answers: the picture is the last one that did not. */
  isBeyond: boolean;
  largestMm: number;
  /** How far that may be off in 95 of 100 cases; null where it is not known. */
  bandMm: number | null;
  errorBoundMm: number;
  isEstimate: boolean;
  legend: MapLegend | null;
}

/** The head that moves: a plan, what answers it, and the picture. */
export class MovingHead {
  readonly plan: Plan;
  readonly view: HeadView;
  /** Pictures shown so far. */
  answered = 0;
  onShown: (shown: Shown) => void = () => {};

  private readonly colors: FaceColors;
  private readonly planned: ReadonlyMap<string, Pose>;
  private readonly displacements: Float32Array;
  private readonly lengths: Float32Array[];
  private readonly bands: Float32Array[];
  private isColored = false;
  private isAsking = false;
  private isWaiting = false;

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
    this.plan.onChange(() => void this.follow());
  }

  /** Throws an Error where the answers are of other vertices than the surfaces follow. */
  static async make(container: HTMLElement, data: MovingData, engine: Engine, listener: StageListener): Promise<MovingHead> {
    const atRest = await engine.ask(data.handles.map(({ pivotMm }) => ({ rotationVector: [0, 0, 0], pivotMm, translationMm: [0, 0, 0], scale: 1 })));
    const count = atRest === null ? 0 : atRest.positions.length / 3;
    const isWithin = data.surfaces.every(({ follows }) => follows === null || follows.places.every((place) => place < count));
    if (atRest === null || !isWithin) throw new Error("the answers are of another head than the surfaces");
    const head = new MovingHead(container, data, engine, Float32Array.from(atRest.positions), listener);
    head.showShare(1);
    return head;
  }

  get isInWorker(): boolean {
    return this.engine.isInWorker;
  }

  get isFast(): boolean {
    return this.engine.isFast;
  }

  /** The picture is that of the newest poses. */
  get isIdle(): boolean {
    return !this.isAsking && !this.isWaiting;
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
    void this.follow();
  }

  /** Asks for the newest poses, one question at a time. */
  private async follow(): Promise<void> {
    this.isWaiting = true;
    if (this.isAsking) return;
    this.isAsking = true;
    while (this.isWaiting) {
      this.isWaiting = false;
      const poses = this.plan.poses();
      this.show(poses, await this.engine.ask(poses));
    }
    this.isAsking = false;
  }

  private show(poses: Pose[], answer: Answer | null): void {
    this.answered += 1;
    if (answer === null) {
      this.onShown({ isBeyond: true, largestMm: 0, bandMm: null, errorBoundMm: 0, isEstimate: false, legend: null });
      return;
    }
    const { head } = this.view;
    subtractInto(answer.positions, this.rest, this.displacements);
    head.setDisplacements(this.displacements);
    this.view.setPoses(new Map(this.data.handles.map(({ name }, index) => [name, poses[index]])));
    let legend: MapLegend | null = null;
    if (this.isColored) legend = this.colors.showLengths("Movement of the skin", this.displacements);
    else this.colors.clear();
    this.onShown({ isBeyond: false, ...this.largest(answer), errorBoundMm: answer.errorBoundMm, isEstimate: answer.isEstimate, legend });
  }

  private largest({ uncertainty }: Answer): Pick<Shown, "largestMm" | "bandMm"> {
    let largestMm = 0;
    let bandMm: number | null = null;
    this.view.head.skins.forEach(({ shape }, s) => {
      shape.spreadLengths(this.displacements, this.lengths[s]);
      if (uncertainty !== null) shape.spread(uncertainty, this.bands[s]);
      this.lengths[s].forEach((length, i) => {
        if (length <= largestMm) return;
        largestMm = length;
        if (uncertainty !== null) bandMm = this.bands[s][i];
      });
    });
    return { largestMm, bandMm };
  }
}

function toCaseSurface({ name, kind, handle, positions, triangles, follows }: MovingData["surfaces"][number]): CaseSurface {
  return { entry: { name, kind, handle, mesh: 0, follows: null, regions: null }, positions, triangles, follows, regions: null };
}
