// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import "../styles/new_plan.css";
import { anatomyStep } from "../building/anatomy_step";
import { readDraft } from "../building/build_drafts";
import { buildStep } from "../building/build_step";
import { ctStep } from "../building/ct_step";
import { headStep } from "../building/head_step";
import { operationStep } from "../building/operation_step";
import { PlanDraft } from "../building/plan_draft";
import { PlanViews } from "../building/plan_views";
import { recipeStep } from "../building/recipe_step";
import { type Step, problemBox } from "../building/step";
import type { Gateway } from "../calls/gateway";
import type { BuildDraft } from "../generated/tissueform/v1/plan_build_service_pb";
import { button, el } from "../panels/dom";
import { pagePart } from "../panels/page_part";

/** From a CT to a case, in steps that are taken in any order: what was done in one stays. `received`: begins with its CT and its recipe. */
export function newPlanPage(gateway: Gateway, received: BuildDraft | null, onCase: (caseName: string) => void, onLeave: () => void, account: HTMLElement | null): { element: HTMLElement; draft: PlanDraft } {
  const draft = new PlanDraft(received === null ? sessionStorage : storageOf(received));
  const problem = problemBox();
  const files = () => pagePart(() => import("../volume/opened_ct"));
  const operation = operationStep(draft);
  const steps: Step[] = [
    ctStep(draft, files, () => show(1), received === null ? null : { name: received.name, title: received.title, read: (onProgress) => readDraft(gateway, received, onProgress) }),
    anatomyStep(draft),
    headStep(draft),
    operation,
    recipeStep(draft),
    buildStep(gateway, draft, files, onCase, received?.title),
  ];
  let current = 0;
  let views: PlanViews | null = null;

  const tabs = steps.map((step, index) => button(`${index + 1}. ${step.title}`, () => show(index)));
  const undo = button("Undo", () => draft.undo());
  const back = button("Back", () => show(current - 1));
  const next = button("Next", () => show(current + 1));
  const panel = el("aside", { attributes: { "aria-label": "Step", tabindex: "-1" } });
  const main = el("main", {});
  const empty = el("p", { class: "quiet", text: "Slices and bone appear here once a CT was read." });

  const show = (index: number) => {
    current = Math.max(0, Math.min(steps.length - 1, index));
    const hadFocus = panel.contains(document.activeElement);
    panel.replaceChildren(problem.element, steps[current].element, el("div", { class: "buttons way" }, [back, next]));
    panel.scrollTop = 0;
    // The keyboard goes on at the beginning of the step.
    if (hadFocus) panel.focus();
    tabs.forEach((tab, at) => (at === current ? tab.setAttribute("aria-current", "step") : tab.removeAttribute("aria-current")));
    update();
  };
  const update = () => {
    if (draft.shown !== null && views === null) {
      views = new PlanViews(draft, { onPieces: (answer, ms) => operation.showPieces(answer, ms), onProblem: problem.show });
      main.replaceChildren(views.element);
    }
    steps.forEach((step) => step.update());
    views?.show(steps[current] === operation ? "cuts" : "references", operation.marginMm);
    tabs.forEach((tab, at) => (tab.disabled = steps[at].needsCt && draft.shown === null));
    undo.disabled = !draft.canUndo;
    back.disabled = current === 0;
    next.disabled = current === steps.length - 1 || (steps[current + 1].needsCt && draft.shown === null);
  };
  main.append(empty);
  show(0);
  draft.watch(update);
  const header = el("header", {}, [el("h1", { text: "New plan from a CT" }), el("span", { class: "quiet", text: "Not a medical device" }), undo, button("Cases", onLeave), account]);
  const nav = el("nav", { attributes: { "aria-label": "Steps" } }, [el("ol", {}, tabs.map((tab) => el("li", {}, [tab])))]);
  return { element: el("div", { class: "new-plan" }, [header, nav, main, panel]), draft };
}

/** Each draft has its own recipe in the tab; the first is the one that came with it. */
function storageOf({ name, recipeJson }: BuildDraft): Pick<Storage, "getItem" | "setItem"> {
  return {
    getItem: (key) => sessionStorage.getItem(`${key} ${name}`) ?? (recipeJson === "" ? null : recipeJson),
    setItem: (key, text) => sessionStorage.setItem(`${key} ${name}`, text),
  };
}
