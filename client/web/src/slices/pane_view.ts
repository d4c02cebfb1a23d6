// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type Vector, add, dot, scaled, subtract } from "../geometry/rotation";
import { type Plane, type PlaneFrame, ontoPlane, planeFrame } from "./plane_frame";
import type { SliceScene } from "./slice_scene";

/** Which part of a slice a pane shows. Pixels are CSS pixels from the pane's upper left corner. */
export class PaneView {
  /** LPS, mm: the point in the middle of the pane; not necessarily on the slice. */
  middle: Vector = [0, 0, 0];
  mmPerPixel = 0.5;
  width = 0;
  height = 0;
  frame: PlaneFrame;

  constructor(
    readonly plane: Plane,
    protected readonly scene: SliceScene,
  ) {
    this.frame = planeFrame(plane, scene.axes);
  }

  /** Along the normal of the slices, from the origin of LPS. */
  get positionMm(): number {
    return dot(this.scene.crosshair, this.frame.normal);
  }

  /** On the slice. */
  toPoint(x: number, y: number): Vector {
    const { right, down, normal } = this.frame;
    const inPane = add(this.middle, add(scaled(right, (x - this.width / 2) * this.mmPerPixel), scaled(down, (y - this.height / 2) * this.mmPerPixel)));
    return ontoPlane(inPane, this.scene.crosshair, normal);
  }

  toPixel(point: Vector): [number, number] {
    const offset = subtract(point, this.middle);
    return [this.width / 2 + dot(offset, this.frame.right) / this.mmPerPixel, this.height / 2 + dot(offset, this.frame.down) / this.mmPerPixel];
  }

  /** What is below this pixel stays there. */
  zoom(factor: number, x = this.width / 2, y = this.height / 2): void {
    const before = this.toPoint(x, y);
    this.mmPerPixel = Math.max(0.01, Math.min(10, this.mmPerPixel * factor));
    this.middle = add(this.middle, subtract(before, this.toPoint(x, y)));
  }

  pan(dx: number, dy: number): void {
    const { right, down } = this.frame;
    this.middle = subtract(this.middle, add(scaled(right, dx * this.mmPerPixel), scaled(down, dy * this.mmPerPixel)));
  }
}
