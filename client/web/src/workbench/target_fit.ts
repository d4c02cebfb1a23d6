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
import type { TargetPlace } from "./target_place";

/** Of one point or region of the skin: how far it is to go, in the head frame, from rest. */
export interface Target {
  label: string;
  place: TargetPlace;
  move: { forwardMm: number; leftMm: number; upMm: number };
  /** Only along `move`; across it the skin goes as it will. */
  isAlong: boolean;
  /** By the user; else `move` is where the skin was when it was chosen. */
  isChanged: boolean;
}

export type FitAsk = Omit<MessageInitShape<typeof FitRequestSchema>, "$typeName" | "session" | "model">;

/** What the server has found for the newest targets. */
export interface Fitted {
  response: FitResponse;
  milliseconds: number;
}

const MIN_TARGET_MM = 1e-3;

/** But for rounding. */
export function isSameMove(a: Target["move"], b: Target["move"]): boolean {
  return Math.hypot(a.forwardMm - b.forwardMm, a.leftMm - b.leftMm, a.upMm - b.upMm) < 1e-6;
}

/**
 * The face that is targeted, and the poses that give it: the server is asked while the user drags, one call at a time, and then only
 * for the newest of the targets that came during a call. The plan shows the result, which becomes a step of it when it is accepted.
 * Before a target is changed, no call is made: the face stays as it is. Targets end with any other change of the plan.
 */
export class TargetFit {
  readonly targets = new Signal<readonly Target[]>([]);
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
  /** The change of the plan that is heard of is this object's own. */
  private isShowing = false;
  /** How often targets have ended: an answer to ended targets does not apply to later ones. */
  private ends = 0;

  constructor(
    private readonly file: CaseFile,
    private readonly plan: Plan,
    private readonly ask: (request: FitAsk) => Promise<FitResponse>,
    private readonly onOvertaken: () => void = () => {},
    private readonly now: () => number = () => performance.now(),
  ) {
    this.free = new Set(plan.handles.map(({ name }) => name));
    plan.onChange(() => this.planChanged());
  }

  get isActive(): boolean {
    return this.targets.value.length > 0;
  }

  /** Something else than what is shown is targeted. */
  get isAsked(): boolean {
    return this.targets.value.some(({ isChanged }) => isChanged);
  }

  /**
   * Asks again, unless others were added that are not changed yet. The poses of the plan when the first target was changed are where
   * the search begins.
   */
  set(targets: readonly Target[]): void {
    const before = this.targets.value;
    if (!this.isAsked) this.start = this.planPoses();
    this.targets.value = targets;
    const areThere = before.every((target, index) => target === targets[index]);
    if (areThere && targets.slice(before.length).every(({ isChanged }) => !isChanged)) return;
    if (this.isAsked) void this.update();
    else this.leave();
  }

  /** While nothing is asked targets go with the face. `moveOf`: of the skin at a place, from rest, as it is shown. */
  follow(moveOf: (place: TargetPlace) => Target["move"]): void {
    if (!this.isActive || this.isAsked) return;
    const targets = this.targets.value.map((target) => ({ ...target, move: moveOf(target.place) }));
    if (targets.some(({ move }, index) => !isSameMove(move, this.targets.value[index].move))) this.targets.value = targets;
  }

  /** The bounds have changed. */
  async update(): Promise<void> {
    if (!this.isAsked) return;
    this.isStale = true;
    if (this.isAsking.value) return;
    this.isAsking.value = true;
    while (this.isStale && this.isAsked) {
      this.isStale = false;
      await this.once();
    }
    this.isAsking.value = false;
  }

  /** What was found is for the newest targets. */
  get isSettled(): boolean {
    return this.found !== null && this.problem.value === null && !this.isAsking.value;
  }

  /** What was found is a step of the plan. */
  accept(): void {
    const { found } = this;
    if (found !== null) this.show(() => this.plan.setPoses(found));
    this.end();
  }

  reject(): void {
    if (this.isActive) this.leave();
    this.end();
  }

  private leave(): void {
    if (this.found !== null) this.show(() => this.plan.revert());
    this.forget();
  }

  private end(): void {
    this.targets.value = [];
    this.forget();
  }

  private forget(): void {
    this.ends += 1;
    this.found = null;
    this.fitted.value = null;
    this.problem.value = null;
  }

  private async once(): Promise<void> {
    const [begun, ends] = [this.now(), this.ends];
    try {
      const response = await this.ask(this.request());
      if (ends !== this.ends) return;
      const found = fromMessages(response.poses);
      this.found = found;
      this.problem.value = null;
      this.fitted.value = { response, milliseconds: this.now() - begun };
      this.show(() => this.plan.preview(found));
    } catch (thrown) {
      if (ends === this.ends) this.problem.value = thrown;
    }
  }

  private show(change: () => void): void {
    this.isShowing = true;
    try {
      change();
    } finally {
      this.isShowing = false;
    }
  }

  /** Another part of the page changed the plan: the result belongs to a plan that is gone. The plan has already removed it. */
  private planChanged(): void {
    if (this.isShowing || !this.isAsked) return;
    this.end();
    this.onOvertaken();
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
      targets: this.targets.value.map((target, index) => this.target(target, index)),
      freedoms: this.plan.handles.flatMap((handle, index) => (this.free.has(handle.name) ? [this.freedom(index)] : [])),
      poses: toMessages(names, poses),
      symmetric: this.isSymmetric,
    };
  }

  private target({ place, move, isAlong }: Target, index: number): NonNullable<FitAsk["targets"]>[number] {
    const shift = toLps(move, this.file.manifest.headFrame).map((part) => part / place.share) as Vector;
    const byMm = Math.hypot(...shift);
    const at = place.vertices === null ? { case: "pointMm" as const, value: vector(place.pointMm) } : { case: "vertices" as const, value: { vertices: place.vertices } };
    const wanted =
      isAlong && byMm > MIN_TARGET_MM
        ? { case: "movement" as const, value: { direction: vector(shift), byMm } }
        : { case: "displacementMm" as const, value: vector(shift) };
    return { name: `target ${index + 1}`, at, wanted };
  }

  /**
   * The part of the case's limits that is searched. They hold along the axes of the head, bounds of the search along those of the
   * scanner: within a head that lies aslant there is room for a smaller box only.
   */
  get limitShare(): number {
    const axes = headAxes(this.file.manifest.headFrame);
    return 1 / Math.max(...[0, 3, 6].map((row) => Math.abs(axes[row]) + Math.abs(axes[row + 1]) + Math.abs(axes[row + 2])));
  }

  private freedom(handle: number): NonNullable<FitAsk["freedoms"]>[number] {
    const { name, limits } = this.plan.handles[handle];
    const mm = limits.translationMm * this.limitShare;
    const radians = (Math.min(90, limits.rotationDeg * this.limitShare) * Math.PI) / 180;
    const ranges = (most: number) => ({ x: { lowest: -most, highest: most }, y: { lowest: -most, highest: most }, z: { lowest: -most, highest: most } });
    return { handle: name, translationMm: ranges(mm), rotationVector: ranges(radians), pivotMm: vector(this.plan.pivot(handle)) };
  }
}

function vector([x, y, z]: Vector) {
  return { x, y, z };
}
