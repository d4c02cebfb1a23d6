// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { VIRIDIS, colorTable, colorize } from "../geometry/color_map";
import { type Vector, add, scaled, subtract } from "../geometry/rotation";
import { type Contact, MOST_GAP_MM, type Teeth, ToothContact } from "../geometry/tooth_contact";
import { MOST_OPENING_DEG, incisorDistanceMm, lowerJawHandles } from "../planning/jaw_opening";
import { formatNumber } from "../planning/numbers";
import type { DrawnSurface } from "../scene/head";
import type { ShownLegend } from "../workbench/face_colors";
import type { Workbench } from "../workbench/workbench";
import { button, collapsible, el, throttleToFrame, slider } from "./dom";

/** The jaw that opens about its condyles, and how the teeth meet. */
export function jawPanel(bench: Workbench): HTMLElement {
  const bite = bitePart(bench);
  return collapsible("Jaw and occlusion", [openingPart(bench), bite.element], (isOpen) => {
    bench.view.setPoints("axis", isOpen ? axisPoints(bench) : []);
    if (!isOpen) bite.off();
    if (!isOpen && bench.jaw.degrees !== 0) bench.open(0);
  });
}

const AXIS_POINTS = 40;

function axisPoints({ jaw: { hinge } }: Workbench): Vector[] {
  if (hinge === null) return [];
  const { left, right } = hinge;
  return Array.from({ length: AXIS_POINTS + 1 }, (_, i) => add(right, scaled(subtract(left, right), i / AXIS_POINTS)));
}

function openingPart(bench: Workbench): HTMLElement {
  const { hinge } = bench.jaw;
  if (hinge === null || lowerJawHandles(bench.file).length === 0) {
    return el("p", { class: "quiet", text: "The case has no mandible segment, or no information about its condyles." });
  }
  const status = el("p", { attributes: { role: "status" } });
  const control = slider("Jaw rotation (hinge axis)", { least: 0, most: MOST_OPENING_DEG, step: 0.5, value: 0 }, (value) => bench.open(value));
  const show = () => {
    const mm = incisorDistanceMm(bench.file, bench.shownPoses);
    const { degrees } = bench.jaw;
    status.textContent = `${degrees === 0 ? "Closed as planned" : `Open by ${formatNumber(degrees)}°`}${mm === null ? "" : `, ${formatNumber(mm)} mm between the incisors`}.`;
    control.value = String(degrees);
    control.setAttribute("aria-valuetext", `${formatNumber(degrees)} degrees`);
  };
  bench.shown.watch(throttleToFrame(show));
  show();
  const how = hinge.source === "landmarks" ? "the case’s landmarks of the condyles" : "the upper back ends of the lower jaw, for the case names no condyles";
  return el("div", { class: "landmark-part" }, [
    el("label", { class: "inline" }, ["Opening", control]),
    status,
    el("p", { class: "quiet", text: `A hinge through ${how} (blue points). The condyles do not translate; the opening is not part of the plan. It is an illustration, not a prediction: beyond about 10° no model bears the tissue around the ramus.` }),
    el("div", { class: "buttons" }, [button("Close", () => bench.open(0))]),
  ]);
}

const SETTLE_MS = 150;
/** Dark to bright: far to near. */
const LEGEND: ShownLegend = { title: "Distance between upper and lower teeth", ticksMm: [MOST_GAP_MM, MOST_GAP_MM / 2, 0], note: `yellow: contact; dark: ${MOST_GAP_MM} mm apart or more` };

/** Teeth alone, with the distance between upper and lower as colors. */
function bitePart(bench: Workbench): { element: HTMLElement; off(): void } {
  const { surfaces } = bench.view.head;
  const lower = lowerJawHandles(bench.file);
  const teeth = surfaces.filter(({ source }) => source.entry.kind === "teeth");
  const isLower = ({ source }: DrawnSurface) => lower.includes(source.entry.handle);
  const [below, above] = [teeth.filter(isLower), teeth.filter((surface) => !isLower(surface))];
  if (below.length === 0 || above.length === 0) {
    return { element: el("p", { class: "quiet", text: "The case has no teeth of both jaws." }), off: () => {} };
  }
  const status = el("p", { attributes: { role: "status" } });
  let test: ToothContact | null = null;
  let timer: ReturnType<typeof setTimeout> | undefined;
  const isOn = () => toggle.getAttribute("aria-pressed") === "true";
  const find = () => {
    if (!isOn()) return;
    test ??= new ToothContact(above.map(toTeeth), below.map(toTeeth));
    const contact = test.find(bench.shownPoses);
    bench.view.head.colorSurfaces([...above, ...below], [...contact.upperMm, ...contact.lowerMm].map(distanceColors));
    bench.view.stage.invalidate();
    status.textContent = contactText(contact);
  };
  const set = (isShown: boolean) => {
    toggle.setAttribute("aria-pressed", String(isShown));
    bench.showBite(isShown ? LEGEND : null);
    if (!isShown) bench.view.head.colorSurfaces([...above, ...below], null);
    status.textContent = "";
    bench.view.stage.invalidate();
    find();
  };
  const toggle = button("Show occlusal contacts", () => set(!isOn()), { attributes: { "aria-pressed": "false" } });
  bench.shown.watch(() => {
    clearTimeout(timer);
    timer = setTimeout(find, SETTLE_MS);
  });
  return { element: el("div", { class: "landmark-part" }, [el("div", { class: "buttons" }, [toggle]), status]), off: () => isOn() && set(false) };
}

function toTeeth({ source }: DrawnSurface): Teeth {
  return { positions: source.positions, triangles: source.triangles, handle: source.entry.handle };
}

const TABLE = colorTable(VIRIDIS);

function distanceColors(distancesMm: Float32Array): Uint8Array {
  const colors = new Uint8Array(3 * distancesMm.length);
  colorize(distancesMm.map((mm) => MOST_GAP_MM - Math.max(0, mm)), MOST_GAP_MM, TABLE, colors);
  return colors;
}

function contactText({ areaMm2, deepestMm, leastMm }: Contact): string {
  if (leastMm === null) return `The teeth are more than ${MOST_GAP_MM} mm apart.`;
  if (areaMm2 === 0) return `No contact; the smallest distance is ${formatNumber(leastMm)} mm.`;
  const depth = deepestMm < 0.05 ? "" : `; overlap up to ${formatNumber(deepestMm)} mm`;
  return `Contact on about ${formatNumber(areaMm2, 0)} mm² of the upper teeth${depth}.`;
}
