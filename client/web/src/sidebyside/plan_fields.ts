// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { messageOf } from "../calls/call_error";
import { type Choice, button, el, newId, section, select, whileBusy } from "../panels/dom";
import type { Signal } from "../workbench/signal";
import type { Workbench } from "../workbench/workbench";
import type { ComparedPlan } from "./compared_plan";
import { LEAST_PLANS, MOST_PLANS, type PlanSet, type PlanSource, type SharedMap } from "./plan_set";

const MOST_NAME = 120;

/** What the fields act on. */
export interface FieldParts {
  bench: Workbench;
  set: PlanSet;
  notice: Signal<string>;
  /** The edited plan is to be the planner's. */
  onTaken(): void;
}

/** Which plans are compared, with what, and by which colors. */
export function comparisonFields({ bench, set }: FieldParts): { element: HTMLElement; show(): void } {
  let source: PlanSource | null = null;
  const sources = select<PlanSource>("New plan", [], (chosen) => (source = chosen));
  const add = button("Add", () => source !== null && set.add(source), { attributes: { "aria-label": "Add the plan" } });
  sources.element.append(add);
  sources.element.classList.add("with-button");
  const reference = select<ComparedPlan | null>("Differences to", [], (plan) => (set.reference.value = plan));
  const map = select<SharedMap>("Color by", [], (kind) => (set.map.value = kind));
  const full = el("p", { class: "quiet", text: `At most ${MOST_PLANS} plans: remove one to add another.` });
  const show = () => {
    const choices = set.sources().map((value) => ({ value, label: value.label }));
    source = choices[0].value;
    sources.set(choices, 0);
    full.hidden = !(add.disabled = set.plans.value.length >= MOST_PLANS);
    const plans: Choice<ComparedPlan | null>[] = [{ value: null, label: "Pre-op" }, ...set.plans.value.map((plan) => ({ value: plan, label: plan.label }))];
    reference.set(plans, plans.findIndex(({ value }) => value === set.reference.value));
    const maps = mapChoices(bench);
    if (maps.every(({ value }) => value !== set.map.value)) set.map.value = "none";
    map.set(maps, maps.findIndex(({ value }) => value === set.map.value));
  };
  set.plans.watch(show);
  bench.stored.all.watch(show);
  return { element: section("Comparison", [sources.element, full, reference.element, map.element]), show };
}

function mapChoices(bench: Workbench): Choice<SharedMap>[] {
  const choices: Choice<SharedMap>[] = [
    { value: "none", label: "Skin color" },
    { value: "movement", label: "Movement of the skin" },
    { value: "difference", label: "Difference to the plan chosen above" },
  ];
  return bench.hasBandAtOnce ? [...choices, { value: "band", label: "95 % interval (material)" }] : choices;
}

/** Name of the edited plan, and what becomes of it. */
export function planFields({ bench, set, notice, onTaken }: FieldParts): HTMLElement {
  const id = newId("plan-name");
  const name = el("input", { id, attributes: { type: "text", maxlength: String(MOST_NAME), autocomplete: "off" } });
  const active = () => set.active.value;
  name.addEventListener("change", () => {
    active().name = name.value.trim() || "Untitled";
    set.plans.value = [...set.plans.value];
  });
  const onError = (thrown: unknown) => (notice.value = messageOf(thrown));
  const store = button("Store", () => void whileBusy(store, () => storePlan(bench, active(), notice), onError), { attributes: { title: "Compute the full solution and store it on the server" } });
  const take = button("Take this plan", onTaken, { attributes: { title: "Make it the planner’s plan" } });
  const remove = button("Remove", () => set.remove(active()), { attributes: { title: "Remove the plan from the comparison" } });
  const field = el("div", { class: "field" }, [el("label", { text: "Name", attributes: { for: id } }), name]);
  const part = section("Plan", [field, el("div", { class: "buttons" }, [take, store, remove])]);
  const heading = part.querySelector("h2") as HTMLElement;
  const show = () => {
    name.value = active().name;
    heading.textContent = `Plan ${active().letter}`;
    const isOwn = active() === set.own;
    take.disabled = name.disabled = isOwn;
    remove.disabled = isOwn || set.plans.value.length <= LEAST_PLANS;
  };
  set.active.watch(show);
  set.plans.watch(show);
  return part;
}

async function storePlan(bench: Workbench, { plan, name }: ComparedPlan, notice: Signal<string>): Promise<void> {
  notice.value = "The server computes the full solution and stores it.";
  const prediction = await bench.stored.store(name, plan.poses());
  notice.value = `Stored “${prediction.title}”.`;
}
