// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { messageOf } from "../calls/call_error";
import type { Workbench } from "../workbench/workbench";
import { button, whileBusy } from "./dom";
import { pagePart } from "./page_part";

/** Slices of a plan, as they are when they are shown. */
interface ShownSlices {
  readonly views: { readonly element: HTMLElement };
  refresh(): void;
}

/** Shows or hides the slices below the picture of `main`; they are fetched when they are first shown. */
export function slicesButton(bench: Workbench, main: HTMLElement): HTMLElement {
  let slices: ShownSlices | null = null;
  const show = (isShown: boolean) => {
    if (slices === null) return;
    slices.views.element.hidden = !isShown;
    main.classList.toggle("with-slices", isShown);
    control.setAttribute("aria-pressed", String(isShown));
    if (isShown) slices.refresh();
  };
  const open = async () => {
    const { PlannerSlices } = await pagePart(() => import("../slices/planner_slices"));
    slices = new PlannerSlices(bench);
    main.append(slices.views.element);
    show(true);
  };
  const toggle = () => {
    if (slices !== null) show(slices.views.element.hidden);
    else void whileBusy(control, open, (thrown) => (bench.notice.value = messageOf(thrown)));
  };
  const control = button("Slices", toggle, { attributes: { "aria-pressed": "false", title: "Axial, coronal and sagittal slices" } });
  return control;
}
