// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import "../styles/side_by_side.css";
import { button, coverPage, el, throttleToFrame } from "../panels/dom";
import { lookByKey, undoByKey } from "../panels/keyboard";
import { wholeBandText } from "../measures/texts";
import { legendBox } from "../panels/maps_panel";
import { lostBox, noPicture } from "../panels/picture_box";
import { noticeBox } from "../panels/status_bar";
import { viewBar } from "../panels/view_bar";
import { HeadPanes } from "../scene/head_panes";
import type { MapLegend } from "../workbench/face_colors";
import { Signal } from "../workbench/signal";
import type { Workbench } from "../workbench/workbench";
import { comparisonFields, planFields } from "./plan_fields";
import { PlanPane } from "./plan_pane";
import { PlanSet } from "./plan_set";
import { PlanTable } from "./plan_table";
import { missingCount, tableGroups } from "./table_rows";

const LABEL = "3D views of the plans. Arrow keys rotate all of them, plus and minus zoom, 1 to 5 look from the front, left, right, 3/4 and below.";
const CLICK_PX = 4;

/** Two to four plans of a case side by side, over the planner. */
export class SideBySidePage {
  private readonly notice = new Signal("");
  private readonly container = el("div", { class: "panes" });
  private readonly panes: HeadPanes;
  private readonly set: PlanSet;
  private readonly table = new PlanTable();
  private readonly segments = el("div");
  private readonly fields: ReturnType<typeof comparisonFields>;
  private readonly element: HTMLElement;
  private readonly update = throttleToFrame(() => this.draw());
  private readonly updateMarks = throttleToFrame(() => this.shown.forEach((pane) => pane.updateMarks()));
  private readonly lost: ReturnType<typeof lostBox>;
  private shown: PlanPane[] = [];
  private close: () => void = () => {};

  constructor(private readonly bench: Workbench) {
    this.lost = lostBox({ restore: () => this.panes.stage.restore() });
    this.panes = new HeadPanes(this.container, { onDrawn: this.updateMarks, onContext: (isLost) => this.lost.show(isLost) });
    this.set = new PlanSet(bench, this.update);
    this.set.plans.watch(() => this.showPanes());
    const parts = { bench, set: this.set, notice: this.notice, onTaken: () => this.taken() };
    this.fields = comparisonFields(parts);
    this.element = this.build(planFields(parts));
    [this.set.active, this.set.reference, this.set.map].forEach((signal) => (signal as Signal<unknown>).watch(this.update));
    bench.landmarks.onChange(this.update);
  }

  /** `onClosed`: the planner is shown again. */
  open(onClosed: () => void): void {
    const { camera, controls } = this.bench.view.stage;
    const uncover = coverPage(this.element);
    this.fields.show();
    this.bench.view.stage.setDrawing(false);
    document.addEventListener("keydown", this.undo, true);
    this.panes.open(camera.position.clone().sub(controls.target));
    this.bindStage();
    this.set.open(true);
    this.close = () => {
      document.removeEventListener("keydown", this.undo, true);
      this.set.open(false);
      this.panes.close();
      uncover();
      this.bench.view.stage.setDrawing(true);
      onClosed();
    };
    this.element.querySelector("button")?.focus();
  }

  private build(ofPlan: HTMLElement): HTMLElement {
    const notice = noticeBox();
    this.notice.watch(notice.show);
    this.bench.notice.watch((text) => (this.notice.value = text));
    const header = el("header", {}, [
      button("Back to the planner", () => this.close()),
      el("h1", { text: "Plans side by side" }),
      el("span", { class: "notice-mark", text: "Not a medical device" }),
    ]);
    const legend = legendBox({ bite: this.set.legend, map: { legend: new Signal<MapLegend | null>(null) } });
    const picture = el("div", { class: "panes-box" }, [this.container, this.lost.element, notice.element]);
    const aside = el("aside", { attributes: { "aria-label": "Plans" } }, [this.fields.element, ofPlan, this.segments]);
    return el("div", { class: "planner side-by-side" }, [header, el("main", {}, [picture, legend, viewBar(this.panes)]), this.table.element, aside]);
  }

  private taken(): void {
    const { letter } = this.set.active.value;
    this.set.take(this.set.active.value);
    void this.bench.compare(null);
    this.close();
    this.bench.notice.value = `Plan ${letter} is the planner’s plan now. Undo restores the earlier one.`;
  }

  /** Panes of plans that are still there stay as they are. */
  private showPanes(): void {
    const parts = { bench: this.bench, panes: this.panes, notice: this.notice, onChosen: (plan: PlanPane["plan"]) => (this.set.active.value = plan) };
    const before = this.shown;
    this.shown = this.set.plans.value.map((plan) => before.find((pane) => pane.plan === plan) ?? new PlanPane(plan, parts));
    before.filter((pane) => !this.shown.includes(pane)).forEach(({ box }) => box.remove());
    this.container.append(...this.shown.filter((pane) => !before.includes(pane)).map(({ box }) => box));
    this.container.dataset.count = String(this.shown.length);
    this.panes.setPanes(this.shown);
    if (this.panes.isOpen) this.shown.forEach((pane) => pane.open());
    this.update();
  }

  private bindStage(): void {
    const { surface, hasRenderer } = this.panes.stage;
    surface.setAttribute("role", "application");
    surface.setAttribute("aria-label", LABEL);
    surface.addEventListener("keydown", (event) => lookByKey(this.panes, event) && event.preventDefault());
    let downAt = [0, 0];
    surface.addEventListener("pointerdown", ({ clientX, clientY }) => (downAt = [clientX, clientY]));
    surface.addEventListener("pointerup", ({ clientX, clientY }) => {
      const pane = this.shown[this.panes.paneAt(clientX, clientY)];
      if (pane !== undefined && Math.hypot(clientX - downAt[0], clientY - downAt[1]) <= CLICK_PX) this.set.active.value = pane.plan;
    });
    this.lost.show(false);
    if (!hasRenderer) surface.append(noPicture());
    this.shown.forEach((pane) => pane.open());
  }

  /** The planner would undo its own plan whichever is edited. */
  private readonly undo = (event: KeyboardEvent) => {
    if (undoByKey(this.set.active.value.plan, event)) event.stopImmediatePropagation();
  };

  private draw(): void {
    if (!this.panes.isOpen) return;
    const { plans, active, reference } = this.set;
    this.set.color();
    this.shown.forEach((pane) => pane.show(pane.plan === active.value));
    const own = this.shown.find((pane) => pane.plan === active.value);
    if (own !== undefined && this.segments.firstChild !== own.segments) this.segments.replaceChildren(own.segments);
    const targets = this.bench.targets.isAsked ? this.bench.targets.targets.value : [];
    const columns = plans.value.map((plan) => ({ label: plan.label, isActive: plan === active.value }));
    this.table.show(columns, tableGroups(plans.value, { reference: reference.value, targets }), this.caption());
    this.panes.invalidate();
  }

  private caption(): string {
    const [first] = this.set.plans.value;
    const missing = missingCount(first);
    const isWhole = this.set.plans.value.some(({ bands }) => bands !== null && bands.size > 0);
    return [
      "All plans are answered by the planner’s model.",
      "Directions are those of the head frame; the numbers of a segment are about the planner’s rotation center.",
      isWhole ? wholeBandText("a measure and a landmark’s movement", this.set.plans.value.flatMap(({ bands }) => Array.from(bands?.values() ?? []))) : "",
      this.bench.hasBandAtOnce ? `Below ${isWhole ? "the largest movement" : "a movement"}: 95 % interval, material uncertainty only.` : "",
      missing === 0 ? "" : `${missing} measures need landmarks: confirm them in the planner, under Measures.`,
    ].filter((text) => text !== "").join(" ");
  }
}
