// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { messageOf } from "../calls/call_error";
import { formatNumber } from "../planning/numbers";
import type { Signal } from "../workbench/signal";
import type { Touch } from "../workbench/touch";
import type { Workbench } from "../workbench/workbench";
import { button, el, select, throttleToFrame } from "./dom";

const CHOICES = [
  { value: false, label: "Lips part, tissue slides" },
  { value: true, label: "Tissue sticks, lips are one piece" },
];

/** What the texts of the models say is true where tissue sticks. */
const NO_BAND = "Where lips part no model has a 95 % interval, and models other than Linear elastic take seconds.";

/** Whether tissue touches or sticks, and how it touches now; nothing for a case that has no contact. */
export function contactPart(bench: Workbench, choose: (sticks: boolean) => Promise<void>): HTMLElement {
  const sticks = bench.file.parted !== null;
  if (!sticks && !bench.touches) return el("span", { attributes: { hidden: "" } });
  const field = select("Contact", CHOICES, (value) => {
    if (value !== sticks) choose(value).catch((thrown) => (bench.notice.value = messageOf(thrown)));
  });
  field.set(CHOICES, sticks ? 1 : 0);
  return el("div", {}, [field.element, ...(sticks ? [] : touchPart(bench))]);
}

/** Points where tissue presses, and the same in words. */
function touchPart(bench: Workbench): HTMLElement[] {
  const told = el("p", { class: "quiet", attributes: { role: "status" } });
  const shows = button("Show contact", () => {
    shows.setAttribute("aria-pressed", String(shows.getAttribute("aria-pressed") !== "true"));
    void show();
  }, { attributes: { "aria-pressed": "false" } });
  const show = async () => {
    const touch = await bench.touch();
    const text = describeTouch(touch);
    if (told.textContent !== text) told.textContent = text;
    const isShown = touch !== null && bench.comparison.value === null && bench.bite.value === null && shows.getAttribute("aria-pressed") === "true";
    bench.view.setPoints("contact", isShown ? touch.points : [], isShown ? touch.colors : undefined);
  };
  const later = throttleToFrame(() => void show());
  for (const signal of [bench.answer, bench.comparison, bench.bite, bench.localState]) (signal as Signal<unknown>).watch(later);
  return [el("div", { class: "buttons" }, [shows]), told, el("p", { class: "quiet", text: NO_BAND })];
}

/** How tissue touches, in a sentence or two. */
export function describeTouch(touch: Touch | null): string {
  if (touch === null) return "Where tissue presses is known once this page answers by itself.";
  const { pressingCount, rowCount, mostN, lipsApartMm } = touch;
  const force = pressingCount === 0 ? "" : `, with ${formatNumber(mostN, 3)} N at most at one (bright points: strong)`;
  return `Tissue presses at ${pressingCount} of ${rowCount} places${force}. Lips up to ${formatNumber(lipsApartMm)} mm apart.`;
}
