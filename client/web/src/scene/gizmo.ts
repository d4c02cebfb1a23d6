// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import * as three from "three";
import { TransformControls } from "three/examples/jsm/controls/TransformControls.js";
import { type Pose } from "../geometry/pose";
import { type Matrix, type Vector, add, apply, fromRotationVector, multiply, subtract, toRotationVector, transpose } from "../geometry/rotation";
import type { Head } from "./head";
import type { Stage } from "./stage";

export type GizmoMode = "translate" | "rotate";

/** Where LPS lies in the stage. */
export type StageSpace = Pick<Head, "worldAxes" | "middle" | "toWorld">;

// TransformControls of size 1 has a unit of this part of the picture's height. Its arms are taken 0.6 units from the middle, where they
// are 0.4 units wide: at least 44 pixels, for a finger.
const UNIT_OF_HEIGHT = 1.9 / 8;
const LEAST_UNIT_PX = 110;
const SIZE = 0.8;

/** The handle at a segment's pivot, by which it is taken in the hand. */
export class Gizmo {
  private readonly controls: TransformControls;
  private readonly proxy = new three.Object3D();
  private pivot: Vector = [0, 0, 0];
  private scale = 1;
  private readonly hiddenBy = new Set<string>();
  private readonly listening = new AbortController();
  private readonly sizes = new ResizeObserver(() => this.fitPicture());
  /** The pointer that went down upon the picture first. */
  private pointer: number | null = null;

  /** `onPose`: the segment is pulled there; `isFinal` when the hand lets go. */
  constructor(
    private readonly stage: Stage,
    private readonly head: StageSpace,
    onPose: (pose: Pose, isFinal: boolean) => void,
  ) {
    this.controls = new TransformControls(stage.camera, stage.surface);
    this.controls.disconnect();
    this.sizes.observe(stage.surface);
    this.listen(stage.surface);
    this.controls.setColors(0xe0705f, 0x62b97c, 0x5b9be0, 0xffd34d);
    this.controls.attach(this.proxy);
    stage.scene.add(this.proxy, this.controls.getHelper());
    this.controls.addEventListener("change", () => stage.invalidate());
    this.controls.addEventListener("dragging-changed", (event) => {
      stage.controls.enabled = event.value !== true;
      if (event.value !== true) onPose(this.pose(), true);
    });
    this.controls.addEventListener("objectChange", () => onPose(this.pose(), false));
  }

  get isDragging(): boolean {
    return this.controls.dragging;
  }

  /** Under the mouse is a part of the gizmo. */
  get isTouched(): boolean {
    return this.controls.axis !== null;
  }

  setMode(mode: GizmoMode): void {
    this.controls.setMode(mode);
    this.stage.invalidate();
  }

  /** It is visible, and can be taken, while no part of the page hides it. */
  hide(by: string, isHidden: boolean): void {
    if (isHidden) this.hiddenBy.add(by);
    else this.hiddenBy.delete(by);
    const isVisible = this.hiddenBy.size === 0;
    this.controls.getHelper().visible = isVisible;
    this.controls.enabled = isVisible;
    this.stage.invalidate();
  }

  /** At the pivot of a segment in this pose, whose `pivotMm` that is. */
  place(pose: Pose): void {
    this.pivot = pose.pivotMm;
    this.scale = pose.scale;
    this.proxy.position.copy(this.head.toWorld(add(pose.pivotMm, pose.translationMm)));
    const axes = this.head.worldAxes;
    this.proxy.quaternion.copy(quaternion(multiply(axes, multiply(fromRotationVector(pose.rotationVector), transpose(axes)))));
    this.proxy.updateMatrixWorld();
    this.stage.invalidate();
  }

  dispose(): void {
    this.listening.abort();
    this.sizes.disconnect();
    this.stage.scene.remove(this.proxy, this.controls.getHelper());
    this.controls.detach();
    this.controls.dispose();
  }

  // TransformControls by itself takes every finger for the same one: a second finger would pull, and a zoom that ends on an arm would
  // move bone. Only the first pointer reaches it here, and a gesture that the system takes over lets go.
  private listen(surface: HTMLElement): void {
    const { signal } = this.listening;
    const release = ({ pointerId }: PointerEvent) => {
      if (pointerId !== this.pointer) return;
      this.pointer = null;
      this.controls.pointerUp(null);
    };
    surface.addEventListener("pointerdown", (event) => {
      if (!this.controls.enabled || !event.isPrimary) return;
      this.pointer = event.pointerId;
      this.controls.pointerHover(this.at(event, event.button));
      this.controls.pointerDown(this.at(event, event.button));
      if (this.isDragging) surface.setPointerCapture(event.pointerId);
    }, { signal });
    surface.addEventListener("pointermove", (event) => {
      if (!this.controls.enabled) return;
      if (this.isDragging && event.pointerId === this.pointer) this.controls.pointerMove(this.at(event, -1));
      else if (!this.isDragging && event.pointerType !== "touch") this.controls.pointerHover(this.at(event, -1));
    }, { signal });
    surface.addEventListener("pointerup", release, { signal });
    surface.addEventListener("pointercancel", release, { signal });
  }

  /** What TransformControls reads of a pointer: where in the picture, from -1 to 1, and its button. */
  private at(event: PointerEvent, button: number): PointerEvent {
    const { left, top, width, height } = this.stage.surface.getBoundingClientRect();
    const place = { x: (2 * (event.clientX - left)) / width - 1, y: 1 - (2 * (event.clientY - top)) / height, button };
    return place as PointerEvent;
  }

  private fitPicture(): void {
    this.controls.setSize(Math.max(SIZE, LEAST_UNIT_PX / (UNIT_OF_HEIGHT * Math.max(1, this.stage.surface.clientHeight))));
    this.stage.invalidate();
  }

  private pose(): Pose {
    const back = transpose(this.head.worldAxes);
    const at = add(apply(back, this.proxy.position.toArray()), this.head.middle);
    const turn = rotationOf(this.proxy.quaternion);
    return {
      rotationVector: toRotationVector(multiply(back, multiply(turn, this.head.worldAxes))),
      pivotMm: this.pivot,
      translationMm: subtract(at, this.pivot),
      scale: this.scale,
    };
  }
}

function quaternion(m: Matrix): three.Quaternion {
  const matrix = new three.Matrix4(m[0], m[1], m[2], 0, m[3], m[4], m[5], 0, m[6], m[7], m[8], 0, 0, 0, 0, 1);
  return new three.Quaternion().setFromRotationMatrix(matrix);
}

function rotationOf(q: three.Quaternion): Matrix {
  const e = new three.Matrix4().makeRotationFromQuaternion(q).elements;
  return [e[0], e[4], e[8], e[1], e[5], e[9], e[2], e[6], e[10]];
}
