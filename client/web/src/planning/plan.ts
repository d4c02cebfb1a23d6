// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { HandleEntry, Manifest } from "../case/manifest";
import { History } from "./history";
import { type MoveKey, NO_MOVE, type Pose, type SegmentMove, between, toMove, toPose } from "../geometry/pose";
import type { Vector } from "../geometry/rotation";

/** What a plan needs of a case. */
export interface PlannedCase {
  manifest: Pick<Manifest, "handles" | "headFrame">;
}

/** A move for each handle, in the case's order. */
export type Moves = readonly SegmentMove[];

/** Who changed the plan: so that what shows it need not answer itself. */
export type PlanListener = (plan: Plan, change: { isFinal: boolean }) => void;

export const MOVE_KEYS: readonly MoveKey[] = ["forwardMm", "leftMm", "upMm", "pitchDeg", "rollDeg", "yawDeg"];

interface State {
  moves: Moves;
  pivots: readonly Vector[];
}

/**
 * The planned moves of the bone: a move for each segment about a pivot, within the case's limits, with all that was
 * before. A change that is not final is a step of a movement of the hand: the final one that ends it is what undo takes back.
 * A preview is not a step: the next change of the plan takes it away first.
 */
export class Plan {
  readonly handles: readonly HandleEntry[];
  private readonly history: History<State>;
  private isPreview = false;
  private readonly listeners: PlanListener[] = [];

  /** `state`: where it begins; left out: at rest, about the case's pivots. */
  constructor(
    private readonly file: PlannedCase,
    private state: State = { moves: file.manifest.handles.map(() => ({ ...NO_MOVE })), pivots: file.manifest.handles.map((handle) => handle.pivotMm) },
  ) {
    this.handles = file.manifest.handles;
    this.history = new History(state);
  }

  /** Another plan, which begins with these poses, or those of this plan, about the same pivots. */
  fork(poses?: ReadonlyMap<string, Pose>): Plan {
    return new Plan(this.file, { ...this.state, moves: poses === undefined ? this.moves : this.movesOf(poses) });
  }

  get moves(): Moves {
    return this.state.moves;
  }

  get canUndo(): boolean {
    return this.isPreview || this.history.canUndo;
  }

  get canRedo(): boolean {
    return this.history.canRedo;
  }

  get isAtRest(): boolean {
    return this.moves.every((move) => MOVE_KEYS.every((key) => move[key] === 0) && move.scale === 1);
  }

  pivot(handle: number): Vector {
    return this.state.pivots[handle];
  }

  /** Largest value of `key` either way. */
  limit(handle: number, key: MoveKey): number {
    const { translationMm, rotationDeg } = this.handles[handle].limits;
    return key.endsWith("Mm") ? translationMm : rotationDeg;
  }

  poses(moves: Moves = this.moves): Pose[] {
    return moves.map((move, index) => toPose(move, this.pivot(index), this.file.manifest.headFrame));
  }

  /** Nothing moves. */
  restPoses(): Pose[] {
    return this.poses(this.handles.map(() => ({ ...NO_MOVE })));
  }

  /** Between two poses of one segment: share 0 is `a`, 1 is `b`. */
  poseBetween(handle: number, a: Pose, b: Pose, share: number): Pose {
    const frame = this.file.manifest.headFrame;
    const pivot = this.pivot(handle);
    return toPose(between(toMove(a, pivot, frame), toMove(b, pivot, frame), share), pivot, frame);
  }

  onChange(listener: PlanListener): void {
    this.listeners.push(listener);
  }

  /** What lies beyond a limit is brought to it. True where nothing was. */
  change(handle: number, part: Partial<SegmentMove>, isFinal: boolean): boolean {
    const { moves } = this.base;
    const move = { ...moves[handle], ...part };
    let isWithin = true;
    for (const key of MOVE_KEYS) {
      if (part[key] === undefined) continue;
      const limit = this.limit(handle, key);
      // Beyond it by rounding is not beyond it.
      if (Math.abs(move[key]) > limit + 1e-9) isWithin = false;
      move[key] = Math.min(limit, Math.max(-limit, move[key]));
    }
    this.set({ ...this.base, moves: moves.map((old, index) => (index === handle ? move : old)) }, isFinal);
    return isWithin;
  }

  /** The segment stays where it is; its numbers refer to another point from now on. */
  setPivot(handle: number, pivotMm: Vector): void {
    const { moves } = this.base;
    const move = toMove(this.poses(moves)[handle], pivotMm, this.file.manifest.headFrame);
    this.set(
      {
        moves: moves.map((old, index) => (index === handle ? move : old)),
        pivots: this.state.pivots.map((old, index) => (index === handle ? pivotMm : old)),
      },
      true,
    );
  }

  /** Poses of some handles by name, as a server or the case has them; the others are at rest. */
  setPoses(poses: ReadonlyMap<string, Pose>): void {
    this.set({ ...this.base, moves: this.movesOf(poses) }, true);
  }

  /** Shown and not yet kept: `setPoses` keeps them as one step, `revert` goes back to the newest step. */
  preview(poses: ReadonlyMap<string, Pose>): void {
    this.show({ ...this.history.now, moves: this.movesOf(poses) }, false, true);
  }

  revert(): void {
    this.show(this.history.now, true);
  }

  /** What changes go on from. */
  private get base(): State {
    return this.isPreview ? this.history.now : this.state;
  }

  private movesOf(poses: ReadonlyMap<string, Pose>): Moves {
    return this.handles.map((handle, index) => {
      const pose = poses.get(handle.name);
      return pose === undefined ? { ...NO_MOVE } : toMove(pose, this.pivot(index), this.file.manifest.headFrame);
    });
  }

  /** Of one segment, or of all. */
  reset(handle?: number): void {
    const moves = this.base.moves.map((move, index) => (handle === undefined || handle === index ? { ...NO_MOVE } : move));
    this.set({ ...this.base, moves }, true);
  }

  /** Of a preview takes back that alone. */
  undo(): void {
    this.show(this.isPreview ? this.history.now : this.history.undo(), true);
  }

  redo(): void {
    this.show(this.history.redo(), true);
  }

  private set(state: State, isFinal: boolean): void {
    if (isFinal && JSON.stringify(state) !== JSON.stringify(this.history.now)) this.history.add(state);
    this.show(state, isFinal);
  }

  private show(state: State, isFinal: boolean, isPreview = false): void {
    this.state = state;
    this.isPreview = isPreview;
    this.listeners.forEach((listener) => listener(this, { isFinal }));
  }
}

/** "the plan's pose" of the case. */
export function posesOfCase(file: PlannedCase): Map<string, Pose> {
  const radians = (degrees: Vector): Vector => [(degrees[0] * Math.PI) / 180, (degrees[1] * Math.PI) / 180, (degrees[2] * Math.PI) / 180];
  return new Map(
    file.manifest.handles.map(({ name, pose }) => [
      name,
      { rotationVector: radians(pose.rotationVectorDeg), pivotMm: pose.pivotMm, translationMm: pose.translationMm, scale: pose.scale },
    ]),
  );
}
