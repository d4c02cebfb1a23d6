// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Workbench } from "../workbench/workbench";
import { button, el } from "./dom";

const CLICK_PX = 4;
/** A finger rolls a little while it taps. */
const TAP_PX = 10;

/**
 * A click or tap, not a turn of the picture, goes to the part that asked for a point (`Workbench.picking`); otherwise it takes the segment
 * in the hand. By keys: Enter takes what is in the picture's middle, Escape leaves it.
 */
export function bindPicking(bench: Workbench): void {
  const { surface } = bench.view.stage;
  const take = (x: number, y: number) => {
    const picking = bench.picking.value;
    if (picking?.takeAt !== undefined) return picking.takeAt(x, y);
    picking?.take(bench.view.anchorAt(x, y, picking.kinds));
  };
  let from: [number, number] | null = null;
  // With a second finger it is a zoom, whichever finger rests.
  surface.addEventListener("pointerdown", (event) => (from = bench.gizmo.isTouched || !event.isPrimary ? null : [event.offsetX, event.offsetY]));
  surface.addEventListener("pointerup", (event) => {
    const reach = event.pointerType === "touch" ? TAP_PX : CLICK_PX;
    if (from === null || Math.hypot(event.offsetX - from[0], event.offsetY - from[1]) > reach) return;
    if (bench.picking.value !== null) return take(event.offsetX, event.offsetY);
    const handle = bench.view.segmentAt(event.offsetX, event.offsetY);
    const index = bench.plan.handles.findIndex(({ name }) => name === handle);
    if (index >= 0) bench.selected.value = index;
  });
  surface.addEventListener("keydown", (event) => {
    if (event.key === "Enter") take(surface.clientWidth / 2, surface.clientHeight / 2);
  });
  document.addEventListener("keydown", (event) => {
    if (event.key === "Escape") bench.picking.value = null;
  });
}

/** What is to be clicked, over the picture, with the mark of its middle. */
export function pickingBox(bench: Workbench): HTMLElement {
  const text = el("span");
  const box = el("div", { class: "picking", attributes: { role: "status" } }, [
    el("span", { class: "middle", attributes: { "aria-hidden": "true" } }),
    el("p", {}, [text, " ", el("small", { text: "Keyboard: rotate the picture until the point is in the middle, then press Enter." }), button("Cancel", () => (bench.picking.value = null))]),
  ]);
  bench.picking.watch((picking) => {
    box.hidden = picking === null;
    text.textContent = picking?.prompt ?? "";
    if (picking !== null) bench.view.stage.surface.focus();
  });
  return box;
}
