// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import * as three from "three";
import type { Stage } from "./stage";

/** A picture of all triangles that takes longer waits until nothing moves. */
const SLOW_MS = 50;
const SETTLE_MS = 200;

/** All triangles of a geometry at rest, and fewer while something moves where the browser draws slowly, as it does without a graphics card. */
export class MovingDetail {
  /** The user holds what moves: a hand that pauses is not at rest. */
  isHeld = false;
  private fullMs = Infinity;
  private settling: ReturnType<typeof setTimeout> | undefined;

  /** `coarse`: of the same vertices. */
  constructor(
    private readonly stage: Pick<Stage, "drawNow" | "invalidate">,
    private readonly geometry: three.BufferGeometry,
    private readonly full: Uint32Array,
    private readonly coarse: Uint32Array,
  ) {
    const both = new Uint32Array(full.length + coarse.length);
    both.set(full);
    both.set(coarse, full.length);
    geometry.setIndex(new three.BufferAttribute(both, 1));
    this.show(true);
  }

  /** What is seen has changed. */
  move(): void {
    clearTimeout(this.settling);
    const isSlow = this.fullMs > SLOW_MS;
    this.show(!isSlow);
    if (isSlow && !this.isHeld) this.settling = setTimeout(() => this.settle(), SETTLE_MS);
    this.stage.invalidate();
  }

  dispose(): void {
    clearTimeout(this.settling);
  }

  private settle(): void {
    this.show(true);
    this.fullMs = this.stage.drawNow();
  }

  private show(isFull: boolean): void {
    if (isFull) this.geometry.setDrawRange(0, this.full.length);
    else this.geometry.setDrawRange(this.full.length, this.coarse.length);
  }
}
