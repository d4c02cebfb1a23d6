// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { MessageInitShape } from "@bufbuild/protobuf";
import type { CaseFile } from "../case/case_file";
import type { FitRequestSchema, FitResponse } from "../generated/tissueform/v1/plan_service_pb";
import { type Pose, headAxes, toLps } from "../geometry/pose";
import type { Vector } from "../geometry/rotation";
import { fromMessages, toMessages } from "../live/pose_messages";
import type { Plan } from "../planning/plan";
import { Signal } from "./signal";
import type { WishPlace } from "./wish_place";

/** Of one point or region of the skin: how far it is to go, in the head frame, from rest. */
export interface Wish {
  label: string;
  place: WishPlace;
  move: { forwardMm: number; leftMm: number; upMm: number };
  /** Only along `move`; across it the skin goes as it will. */
  isAlong: boolean;
}

export type FitAsk = Omit<MessageInitShape<typeof FitRequestSchema>, "$typeName" | "session" | "model">;

/** What the server has found for the newest wishes. */
export interface Fitted {
  response: FitResponse;
  milliseconds: number;
}

const LEAST_WISH_MM = 1e-3;

/**
 * The face that is wished for, and the poses that give it: asked of the server while somebody pulls, one call at a time, and of
 * wishes that come meanwhile the newest only. What is found is shown by the plan and becomes a step of it when it is accepted.
 */
export class WishFit {
  readonly wishes = new Signal<readonly Wish[]>([]);
  readonly fitted = new Signal<Fitted | null>(null);
  /** A call is on its way. */
  readonly isAsking = new Signal(false);
  readonly problem = new Signal<unknown>(null);
  /** Which segments may move, and whether they stay in the midsagittal plane. */
  readonly free: Set<string>;
  isSymmetric = false;

  private start: ReadonlyMap<string, Pose> = new Map();
  private isStale = false;
  private found: ReadonlyMap<string, Pose> | null = null;

  constructor(
    private readonly file: CaseFile,
    private readonly plan: Plan,
    private readonly ask: (request: FitAsk) => Promise<FitResponse>,
    private readonly now: () => number = () => performance.now(),
  ) {
    this.free = new Set(plan.handles.map(({ name }) => name));
  }

  get isActive(): boolean {
    return this.wishes.value.length > 0;
  }

  /** Asks again. The poses of the plan when the first wish came are where the search begins. */
  set(wishes: readonly Wish[]): void {
    if (!this.isActive) this.start = this.planPoses();
    this.wishes.value = wishes;
    if (wishes.length === 0) this.leave();
    else void this.update();
  }

  /** The bounds have changed. */
  async update(): Promise<void> {
    if (!this.isActive) return;
    this.isStale = true;
    if (this.isAsking.value) return;
    this.isAsking.value = true;
    while (this.isStale && this.isActive) {
      this.isStale = false;
      await this.once();
    }
    this.isAsking.value = false;
  }

  /** What was found is for the newest wishes. */
  get isSettled(): boolean {
    return this.found !== null && this.problem.value === null && !this.isAsking.value;
  }

  /** What was found is a step of the plan. */
  accept(): void {
    if (this.found !== null) this.plan.setPoses(this.found);
    this.end();
  }

  reject(): void {
    if (this.isActive) this.leave();
    this.end();
  }

  private leave(): void {
    if (this.found !== null) this.plan.revert();
    this.found = null;
    this.fitted.value = null;
    this.problem.value = null;
  }

  private end(): void {
    this.wishes.value = [];
    this.found = null;
    this.fitted.value = null;
    this.problem.value = null;
  }

  private async once(): Promise<void> {
    const begun = this.now();
    try {
      const response = await this.ask(this.request());
      if (!this.isActive) return;
      this.found = fromMessages(response.poses);
      this.problem.value = null;
      this.fitted.value = { response, milliseconds: this.now() - begun };
      this.plan.preview(this.found);
    } catch (thrown) {
      if (this.isActive) this.problem.value = thrown;
    }
  }

  private planPoses(): Map<string, Pose> {
    const poses = this.plan.poses();
    return new Map(this.plan.handles.map(({ name }, index) => [name, poses[index]]));
  }

  private request(): FitAsk {
    const names = this.plan.handles.map(({ name }) => name);
    // From what was found last it is a few steps to what is found next.
    const poses = names.map((name) => ((this.free.has(name) ? this.found?.get(name) : undefined) ?? this.start.get(name)) as Pose);
    return {
      targets: this.wishes.value.map((wish, index) => this.target(wish, index)),
      freedoms: this.plan.handles.flatMap((handle, index) => (this.free.has(handle.name) ? [this.freedom(index)] : [])),
      poses: toMessages(names, poses),
      symmetric: this.isSymmetric,
    };
  }

  private target({ place, move, isAlong }: Wish, index: number): NonNullable<FitAsk["targets"]>[number] {
    const shift = toLps(move, this.file.manifest.headFrame).map((part) => part / place.share) as Vector;
    const byMm = Math.hypot(...shift);
    const at = place.vertices === null ? { case: "pointMm" as const, value: vector(place.pointMm) } : { case: "vertices" as const, value: { vertices: place.vertices } };
    const wanted =
      isAlong && byMm > LEAST_WISH_MM
        ? { case: "movement" as const, value: { direction: vector(shift), byMm } }
        : { case: "displacementMm" as const, value: vector(shift) };
    return { name: `wish ${index + 1}`, at, wanted };
  }

  /** Within the case's limits, which hold along the axes of the head: a box of LPS that lies within theirs. */
  private freedom(handle: number): NonNullable<FitAsk["freedoms"]>[number] {
    const { name, limits } = this.plan.handles[handle];
    const axes = headAxes(this.file.manifest.headFrame);
    const widest = Math.max(...[0, 3, 6].map((row) => Math.abs(axes[row]) + Math.abs(axes[row + 1]) + Math.abs(axes[row + 2])));
    const mm = limits.translationMm / widest;
    const radians = (Math.min(90, limits.rotationDeg / widest) * Math.PI) / 180;
    const ranges = (most: number) => ({ x: { lowest: -most, highest: most }, y: { lowest: -most, highest: most }, z: { lowest: -most, highest: most } });
    return { handle: name, translationMm: ranges(mm), rotationVector: ranges(radians), pivotMm: vector(this.plan.pivot(handle)) };
  }
}

function vector([x, y, z]: Vector) {
  return { x, y, z };
}
