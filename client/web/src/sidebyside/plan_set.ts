// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Prediction } from "../generated/tissueform/v1/prediction_pb";
import { roundUp } from "../geometry/color_map";
import type { Pose } from "../geometry/pose";
import { fromMessages } from "../live/pose_messages";
import { formatNumber } from "../planning/numbers";
import { posesOfCase } from "../planning/plan";
import { type MapLegend, type ShownLegend, subtractInto } from "../workbench/face_colors";
import { Signal } from "../workbench/signal";
import type { Workbench } from "../workbench/workbench";
import { ComparedPlan } from "./compared_plan";

export const LEAST_PLANS = 2;
export const MOST_PLANS = 4;
const LETTERS = ["A", "B", "C", "D"];

/** What lies on the skin of all plans as colors, on one scale. */
export type SharedMap = "none" | "movement" | "difference" | "band";

/** Where the movements of a plan that is added come from. */
export interface PlanSource {
  label: string;
  name: string;
  /** As they are when it is added; handles that are not named are at rest. */
  poses: () => ReadonlyMap<string, Pose>;
}

function predictionSource({ title, poses }: Prediction): PlanSource {
  const name = title || "Untitled";
  return { label: `Prediction “${name}”`, name, poses: () => fromMessages(poses) };
}

/** Two to four plans of one case. The first is the planner's own, with its history; the others are drafts of this page. */
export class PlanSet {
  readonly plans = new Signal<readonly ComparedPlan[]>([]);
  readonly active: Signal<ComparedPlan>;
  /** What differences are to; null: pre-op. */
  readonly reference = new Signal<ComparedPlan | null>(null);
  readonly map = new Signal<SharedMap>("none");
  readonly legend = new Signal<ShownLegend | null>(null);
  private isOpen = false;

  /** `onShown`: a face, a number or a status changed. */
  constructor(
    private readonly bench: Workbench,
    private readonly onShown: () => void,
  ) {
    const own = new ComparedPlan(bench, bench.plan, LETTERS[0], "Planner’s plan", onShown);
    this.active = new Signal(own);
    this.plans.value = [own];
    const newest = bench.stored.all.value[0];
    this.add(newest === undefined ? this.copyOf(own) : predictionSource(newest));
    this.active.value = own;
    this.askAgain();
  }

  /** When the page's own answers come or go, and for plans without an answer when the server is back. */
  private askAgain(): void {
    let kind = "";
    this.bench.localState.watch((state) => {
      if (state.kind !== kind && this.isOpen) this.plans.value.forEach((plan) => plan.ask());
      kind = state.kind;
    });
    this.bench.connection.watch((connection) => {
      if (connection.kind === "live" && this.isOpen) this.plans.value.filter(({ hasFailed }) => hasFailed).forEach((plan) => plan.ask());
    });
  }

  get own(): ComparedPlan {
    return this.plans.value[0];
  }

  open(isOpen: boolean): void {
    this.isOpen = isOpen;
    this.plans.value.forEach((plan) => plan.setActive(isOpen));
  }

  /** What can be added. */
  sources(): PlanSource[] {
    const { file, stored } = this.bench;
    return [
      ...this.plans.value.map((plan) => this.copyOf(plan)),
      { label: "Pre-op", name: "Pre-op", poses: () => new Map() },
      { label: "The case’s plan", name: "Case’s plan", poses: () => posesOfCase(file) },
      ...stored.all.value.map(predictionSource),
    ];
  }

  /** The new plan is the one that is edited. REQUIRES: fewer than MOST_PLANS. */
  add({ name, poses }: PlanSource): void {
    const letter = LETTERS.find((free) => this.plans.value.every((plan) => plan.letter !== free)) as string;
    const plan = new ComparedPlan(this.bench, this.own.plan.fork(poses()), letter, name, this.onShown);
    this.plans.value = [...this.plans.value, plan];
    this.active.value = plan;
    if (this.isOpen) plan.setActive(true);
  }

  /** REQUIRES: more than LEAST_PLANS, and not the planner's own. */
  remove(plan: ComparedPlan): void {
    plan.setActive(false);
    const at = this.plans.value.indexOf(plan);
    this.plans.value = this.plans.value.filter((other) => other !== plan);
    if (this.active.value === plan) this.active.value = this.plans.value[at - 1];
    if (this.reference.value === plan) this.reference.value = null;
  }

  /** It becomes the planner's, as one step. */
  take(plan: ComparedPlan): void {
    this.bench.plan.setPoses(this.bench.posesByHandle(plan.plan.poses()));
  }

  /** Lays the map on all faces that are answered. */
  color(): void {
    const shown = this.plans.value.filter((plan) => plan.isAnswered);
    this.plans.value.filter((plan) => !shown.includes(plan)).forEach(({ colors }) => colors.clear());
    const legends = shown.flatMap((plan) => {
      const legend = this.colorOne(plan);
      return legend === null ? [] : [{ plan, legend }];
    });
    const mostMm = roundUp(Math.max(0, ...legends.map(({ legend }) => legend.largestMm)));
    legends.forEach(({ plan }) => plan.colors.rescale(mostMm));
    const note = legends.map(({ plan, legend }) => `${plan.letter} ${formatNumber(legend.largestMm, 2)}`).join(", ");
    this.legend.value = legends.length === 0 ? null : { title: legends[0].legend.title, ticksMm: [0, mostMm / 2, mostMm], note: `largest: ${note} mm` };
  }

  private colorOne({ colors, displacements, uncertainty }: ComparedPlan): MapLegend | null {
    const map = this.map.value;
    const reference = this.reference.value;
    if (map === "movement" || (map === "difference" && reference === null)) return colors.showLengths("Movement of the skin", displacements);
    if (map === "difference" && reference?.isAnswered === true) {
      return colors.showLengths(`Difference to ${reference.letter}`, subtractInto(displacements, reference.displacements, new Float32Array(displacements.length)));
    }
    if (map === "band" && uncertainty !== null) return colors.showNumbers("95 % interval (stiffness only)", uncertainty);
    colors.clear();
    return null;
  }

  private copyOf(plan: ComparedPlan): PlanSource {
    return { label: `Copy of ${plan.label}`, name: `Copy of ${plan.letter}`, poses: () => this.bench.posesByHandle(plan.plan.poses()) };
  }
}
