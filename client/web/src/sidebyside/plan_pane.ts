// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { button, el } from "../panels/dom";
import { segmentsPanel } from "../panels/segments_panel";
import { pictureMarks } from "../panels/view_bar";
import type { Head } from "../scene/head";
import type { HeadPane, HeadPanes } from "../scene/head_panes";
import type { Signal } from "../workbench/signal";
import type { Workbench } from "../workbench/workbench";
import type { ComparedPlan } from "./compared_plan";

/** What all plans of the page share. */
export interface PaneParts {
  bench: Workbench;
  panes: HeadPanes;
  notice: Signal<string>;
  onChosen(plan: ComparedPlan): void;
}

/** One plan on the page: its name, its picture, its status, and the fields that move its segments. */
export class PlanPane implements HeadPane {
  readonly box: HTMLElement;
  /** Where the head is drawn. */
  readonly element = el("div", { class: "pane-picture" });
  readonly segments: HTMLElement;
  private readonly choose: HTMLButtonElement;
  private readonly status = el("p", { class: "quiet" });
  private marks: { element: HTMLElement; update(): void } | null = null;

  constructor(
    readonly plan: ComparedPlan,
    private readonly parts: PaneParts,
  ) {
    const { bench, notice } = parts;
    this.choose = button(plan.label, () => parts.onChosen(plan), { attributes: { title: "Edit this plan" } });
    this.box = el("section", { class: "pane", attributes: { "aria-label": `Plan ${plan.letter}` } }, [this.choose, this.element, this.status]);
    this.segments = segmentsPanel({ plan: plan.plan, file: bench.file, selected: bench.selected, notice, penetrations: plan.penetrations, view: bench.view });
  }

  get head(): Head {
    return this.plan.head;
  }

  /** The stage is a new one. */
  open(): void {
    this.marks = pictureMarks(this.parts.panes.stage);
    this.element.replaceChildren(this.marks.element);
  }

  updateMarks(): void {
    this.marks?.update();
  }

  show(isActive: boolean): void {
    this.box.classList.toggle("active", isActive);
    this.choose.setAttribute("aria-pressed", String(isActive));
    this.choose.textContent = this.plan.label;
    if (this.status.textContent !== this.plan.status) this.status.textContent = this.plan.status;
  }
}
