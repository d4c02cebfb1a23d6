// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type Drag, type ItemListener, grabItem } from "./item_drag";
import type { SlicePane } from "./slice_pane";
import type { SliceScene } from "./slice_scene";
import { changedWindow } from "./window_level";

export type Tool = "crosshair" | "window" | "pan" | "distance" | "angle";

/** What pointers and keys of a pane change. */
export interface PaneOwner extends ItemListener {
  readonly tool: Tool;
  moveCrosshair(point: [number, number, number]): void;
  /** Along the normal of the pane's slices. */
  scroll(pane: SlicePane, slices: number): void;
  /** A point of the measurement that is being placed, or the first of a new one. */
  measure(pane: SlicePane, point: [number, number, number]): void;
  /** Anything else that is drawn has changed. */
  changed(): void;
}

const REACH_PX = 9;
const TOUCH_REACH_PX = 22;
/** Of a wheel or a touch pad, for one slice. */
const WHEEL_PX = 50;
const WINDOW_PX = 200;
/** A pointer that moved less than this was a click. */
const CLICK_PX = 4;

/** Mouse, pen and fingers on a pane. One finger does what the tool does, two pan and zoom. */
export class PanePointers {
  private readonly places = new Map<number, [number, number]>();
  private drag: Drag | null = null;
  private wheelPx = 0;

  constructor(
    private readonly pane: SlicePane,
    private readonly scene: SliceScene,
    private readonly owner: PaneOwner,
  ) {
    const { surface } = pane;
    surface.addEventListener("pointerdown", (event) => this.down(event));
    surface.addEventListener("pointermove", (event) => this.moved(event));
    surface.addEventListener("pointerup", (event) => this.up(event));
    surface.addEventListener("pointercancel", (event) => this.up(event));
    surface.addEventListener("contextmenu", (event) => event.preventDefault());
    surface.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
  }

  private placeOf({ clientX, clientY }: MouseEvent): [number, number] {
    const { left, top } = this.pane.surface.getBoundingClientRect();
    return [clientX - left, clientY - top];
  }

  private down(event: PointerEvent): void {
    this.pane.surface.setPointerCapture(event.pointerId);
    this.pane.surface.focus({ preventScroll: true });
    event.preventDefault();
    this.endDrag(true);
    this.places.set(event.pointerId, this.placeOf(event));
    if (this.places.size === 1) this.drag = this.begin(event, ...this.placeOf(event));
    this.owner.changed();
  }

  private moved(event: PointerEvent): void {
    const before = this.places.get(event.pointerId);
    if (before === undefined) return;
    const place = this.placeOf(event);
    if (this.places.size === 2) this.pinch(event.pointerId, before, place);
    this.places.set(event.pointerId, place);
    this.drag?.move(...place);
    this.owner.changed();
  }

  private up(event: PointerEvent): void {
    this.places.delete(event.pointerId);
    this.endDrag();
  }

  private endDrag(isPinch = false): void {
    const drag = this.drag;
    this.drag = null;
    if (isPinch && drag?.cancel !== undefined) drag.cancel();
    else drag?.end();
    if (drag !== null) this.owner.changed();
  }

  private begin(event: PointerEvent, x: number, y: number): Drag {
    if (event.button === 1 || event.shiftKey) return this.panDrag(x, y);
    if (event.button === 2) return this.windowDrag(x, y);
    const item = grabItem(this.pane, this.scene, x, y, event.pointerType === "touch" ? TOUCH_REACH_PX : REACH_PX, this.owner);
    if (item !== null) return item;
    const { tool } = this.owner;
    if (tool === "pan") return this.panDrag(x, y);
    if (tool === "window") return this.windowDrag(x, y);
    return tool === "crosshair" ? this.crosshairDrag(x, y) : this.measureDrag(x, y);
  }

  private crosshairDrag(x: number, y: number): Drag {
    const before = this.scene.crosshair;
    const move = (toX: number, toY: number) => this.owner.moveCrosshair(this.pane.toPoint(toX, toY));
    move(x, y);
    return { move, end: () => {}, cancel: () => this.owner.moveCrosshair(before) };
  }

  private panDrag(x: number, y: number): Drag {
    let [lastX, lastY] = [x, y];
    const move = (toX: number, toY: number) => {
      this.pane.pan(toX - lastX, toY - lastY);
      [lastX, lastY] = [toX, toY];
    };
    return { move, end: () => {} };
  }

  /** To the right: wider; upward: darker. */
  private windowDrag(x: number, y: number): Drag {
    const before = this.scene.window;
    const move = (toX: number, toY: number) => (this.scene.window = changedWindow(before, Math.exp((toX - x) / WINDOW_PX), (y - toY) / WINDOW_PX));
    return { move, end: () => {}, cancel: () => (this.scene.window = before) };
  }

  /** Each click places a point; the first two may also be placed by a drag from one to the other. */
  private measureDrag(x: number, y: number): Drag {
    let last: [number, number] = [x, y];
    this.owner.measure(this.pane, this.pane.toPoint(x, y));
    const end = () => {
      if (Math.hypot(last[0] - x, last[1] - y) > CLICK_PX) this.owner.measure(this.pane, this.pane.toPoint(...last));
    };
    return { move: (toX, toY) => (last = [toX, toY]), end };
  }

  private pinch(id: number, before: readonly [number, number], place: readonly [number, number]): void {
    const other = Array.from(this.places).find(([key]) => key !== id)?.[1];
    if (other === undefined) return;
    const [from, to] = [before, place].map(([x, y]) => Math.max(1, Math.hypot(x - other[0], y - other[1])));
    this.pane.pan((place[0] - before[0]) / 2, (place[1] - before[1]) / 2);
    this.pane.zoom(from / to, (place[0] + other[0]) / 2, (place[1] + other[1]) / 2);
  }

  private wheel(event: WheelEvent): void {
    event.preventDefault();
    const px = event.deltaMode === WheelEvent.DOM_DELTA_PIXEL ? event.deltaY : event.deltaY * WHEEL_PX;
    if (event.ctrlKey) {
      this.pane.zoom(Math.exp(px / 400), ...this.placeOf(event));
      this.owner.changed();
      return;
    }
    // A notch of a mouse wheel is one slice, regardless of what the browser counts for it.
    this.wheelPx = Math.abs(px) >= WHEEL_PX ? Math.sign(px) * WHEEL_PX : this.wheelPx + px;
    if (Math.abs(this.wheelPx) < WHEEL_PX) return;
    this.owner.scroll(this.pane, Math.sign(this.wheelPx));
    this.wheelPx = 0;
  }
}
