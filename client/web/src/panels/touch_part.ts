// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { messageOf } from "../calls/call_error";
import { sealedPairs } from "../case/contact_choice";
import { formatNumber } from "../planning/numbers";
import type { Signal } from "../workbench/signal";
import type { Touch } from "../workbench/touch";
import type { Workbench } from "../workbench/workbench";
import { button, el, throttleToFrame } from "./dom";
import { pagePart } from "./page_part";

const BAND = "The material’s part of the 95 % interval of elastic models comes some seconds after the hand rests.";
const NO_BAND = "The material’s part of the 95 % interval is not known of sealed lips.";
/** What the texts of the models say is true where tissue sticks. */
const SLOW_MODELS = " Models other than Linear elastic take seconds.";

/** Points where tissue presses, and the same in words. */
export function touchPart(bench: Workbench): HTMLElement[] {
  const status = el("p", { class: "quiet", attributes: { role: "status" } });
  const shows = button("Show contact", () => {
    shows.setAttribute("aria-pressed", String(shows.getAttribute("aria-pressed") !== "true"));
    void loadAreas()
      .catch((thrown) => (bench.notice.value = messageOf(thrown)))
      .then(show);
  }, { attributes: { "aria-pressed": "false" } });
  let areasMm2: Float64Array | null = null;
  const loadAreas = async () => {
    if (areasMm2 !== null) return;
    const { contactAreas } = await pagePart(() => import("../case/contact_areas"));
    areasMm2 = await contactAreas(bench.file);
  };
  const show = async () => {
    const touch = await bench.touch(areasMm2);
    const text = describeTouch(touch) + describeSeal(sealedPairs(bench.file), await bench.sealState());
    if (status.textContent !== text) status.textContent = text;
    const isShown = touch !== null && bench.comparison.value === null && bench.bite.value === null && shows.getAttribute("aria-pressed") === "true";
    bench.view.setPoints("contact", isShown ? touch.points : [], isShown ? touch.colors : undefined);
  };
  const later = throttleToFrame(() => void show());
  for (const signal of [bench.answer, bench.comparison, bench.bite, bench.localState]) (signal as Signal<unknown>).watch(later);
  return [el("div", { class: "buttons" }, [shows]), status, el("p", { class: "quiet", text: sealedPairs(bench.file) > 0 ? NO_BAND : (bench.file.materialRanges === null ? "" : BAND) + SLOW_MODELS })];
}

/** What became of the seal, with a space before; nothing of free lips. */
export function describeSeal(pairs: number, state: { partedMm: number; released: boolean } | null): string {
  if (pairs === 0) return "";
  if (state === null) return " A seal holds the edges of the lips at one height: posture, not mechanics.";
  const parted = `${formatNumber(state.partedMm)} mm apart in height`;
  return state.released ? ` The seal of the lips is released: their edges are ${parted}.` : ` A seal holds the edges of the lips, which would be up to ${parted}, at one height: posture, not mechanics.`;
}

/** How tissue touches, in a sentence or two. */
export function describeTouch(touch: Touch | null): string {
  if (touch === null) return "Where tissue presses is known once this page answers by itself.";
  const { pressingCount, rowCount, mostN, pressureKpa, lipsApartMm } = touch;
  const pressure = pressureKpa === null ? "" : `; ${formatNumber(pressureKpa.mean)} kPa on average, ${formatNumber(pressureKpa.most)} at most`;
  const force = pressingCount === 0 ? "" : `, with at most ${formatNumber(mostN, 3)} N at one${pressure} (bright points: strong)`;
  return `Tissue presses at ${pressingCount} of ${rowCount} places${force}. Lips up to ${formatNumber(lipsApartMm)} mm apart.`;
}
