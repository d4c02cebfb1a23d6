// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type Vector, add, scaled } from "../geometry/rotation";
import { turnedNormal } from "./item_drag";
import type { PaneOwner } from "./pane_pointers";
import type { SlicePane } from "./slice_pane";
import type { DraggablePlane, SliceScene } from "./slice_scene";
import { PRESETS, changedWindow, wholeRange } from "./window_level";

/** For the list of shortcuts. */
export const KEYS: readonly [string, string][] = [
  ["Page up, page down", "next or previous slice (with Shift: 10)"],
  ["Arrow keys", "move the crosshair, or the selected point or plane, by 1 mm (with Shift: 0.1 mm)"],
  ["N", "select the next point or plane"],
  ["Q, E", "turn the selected plane by 1° (with Shift: 0.1°)"],
  ["Escape", "select nothing; cancel a measurement"],
  ["Enter", "place a point of a measurement at the crosshair"],
  ["Delete", "remove the last measurement"],
  ["W, A, S, D", "pan"],
  ["+, -", "zoom"],
  ["0", "show everything"],
  ["1 to 5", "window presets"],
  ["[, ]", "narrower or wider window"],
  ["Comma, period", "lower or higher window center"],
];

const ARROWS: Record<string, [right: number, down: number]> = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const PANS: Record<string, [number, number]> = { a: [1, 0], d: [-1, 0], w: [0, 1], s: [0, -1] };
const PAN_PX = 30;
const ZOOM = 1.15;
const WINDOW_FACTOR = 1.1;
const RADIANS = Math.PI / 180;

/** What keys do further, beside what pointers do. */
export interface KeyOwner extends PaneOwner {
  select(id: string | null): void;
  cancelMeasurement(): void;
  removeLastMeasurement(): void;
}

/** Everything that a pointer does, by keys, while the pane has the focus. */
export class PaneKeys {
  constructor(
    private readonly pane: SlicePane,
    private readonly scene: SliceScene,
    private readonly owner: KeyOwner,
  ) {
    pane.surface.addEventListener("keydown", (event) => this.press(event));
  }

  private press(event: KeyboardEvent): void {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const isDone = this.moves(event) || this.views(event) || this.measures(event);
    if (!isDone) return;
    // The planner has shortcuts of its own, which must not move bone here.
    event.preventDefault();
    event.stopPropagation();
    this.owner.changed();
  }

  private moves({ key, shiftKey }: KeyboardEvent): boolean {
    const arrow = ARROWS[key];
    if (arrow !== undefined) this.arrow(arrow, shiftKey ? 0.1 : 1);
    else if (key === "PageUp" || key === "PageDown") this.owner.scroll(this.pane, (key === "PageUp" ? 1 : -1) * (shiftKey ? 10 : 1));
    else if (key.toLowerCase() === "n") this.selectNext();
    else if (key.toLowerCase() === "q" || key.toLowerCase() === "e") this.turn((key.toLowerCase() === "q" ? -1 : 1) * (shiftKey ? 0.1 : 1));
    else return false;
    return true;
  }

  private views({ key }: KeyboardEvent): boolean {
    const { pane, scene } = this;
    const pan = PANS[key.toLowerCase()];
    if (pan !== undefined) pane.pan(PAN_PX * pan[0], PAN_PX * pan[1]);
    else if (key === "+" || key === "=") pane.zoom(1 / ZOOM);
    else if (key === "-") pane.zoom(ZOOM);
    else if (key === "0") pane.fit();
    else if (/^[1-4]$/.test(key)) scene.window = PRESETS[Number(key) - 1].window;
    else if (key === "5") scene.window = scene.volume === null ? scene.window : wholeRange(scene.volume);
    else if (key === "[" || key === "]") scene.window = changedWindow(scene.window, key === "[" ? 1 / WINDOW_FACTOR : WINDOW_FACTOR, 0);
    else if (key === "," || key === ".") scene.window = changedWindow(scene.window, 1, key === "," ? -0.05 : 0.05);
    else return false;
    return true;
  }

  private measures({ key }: KeyboardEvent): boolean {
    const { tool } = this.owner;
    if (key === "Enter" && (tool === "distance" || tool === "angle")) this.owner.measure(this.pane, this.scene.crosshair);
    else if (key === "Delete" || key === "Backspace") this.owner.removeLastMeasurement();
    else if (key === "Escape" && (this.scene.selected !== null || tool === "distance" || tool === "angle")) {
      this.owner.select(null);
      this.owner.cancelMeasurement();
    } else return false;
    return true;
  }

  private arrow([right, down]: readonly [number, number], mm: number): void {
    const { frame } = this.pane;
    const step = add(scaled(frame.right, right * mm), scaled(frame.down, down * mm));
    const point = this.scene.points.find(({ id }) => id === this.scene.selected);
    const plane = this.selectedPlane();
    if (point !== undefined) {
      point.position = add(point.position, step);
      this.owner.onPoint(point, true);
    } else if (plane !== undefined) this.shift(plane, right - down, mm);
    else this.owner.moveCrosshair(add(this.scene.crosshair, step));
  }

  /** Right and up: along its normal. */
  private shift(plane: DraggablePlane, sign: number, mm: number): void {
    const unit = scaled(plane.normal, 1 / Math.hypot(...plane.normal));
    plane.point = add(plane.point, scaled(unit, sign * mm));
    this.owner.onPlane(plane, true);
  }

  private turn(degrees: number): void {
    const plane = this.selectedPlane();
    if (plane === undefined) return;
    const { right, down } = this.pane.frame;
    plane.normal = turnedNormal(plane.normal, right, down, degrees * RADIANS);
    this.owner.onPlane(plane, true);
  }

  private selectedPlane(): DraggablePlane | undefined {
    return this.scene.planes.find(({ id, isLocked }) => id === this.scene.selected && isLocked !== true);
  }

  /** The crosshair goes to the item, so that the slices show it. */
  private selectNext(): void {
    const { scene } = this;
    const items: { id: string; at: Vector }[] = [
      ...scene.points.map(({ id, position }) => ({ id, at: position })),
      ...scene.planes.filter(({ isLocked }) => isLocked !== true).map(({ id, point }) => ({ id, at: point })),
    ];
    if (items.length === 0) return;
    const next = items[(items.findIndex(({ id }) => id === scene.selected) + 1) % items.length];
    this.owner.select(next.id);
    this.owner.moveCrosshair(next.at);
  }
}
