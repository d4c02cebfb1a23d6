// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import * as three from "three";
import type { Vector } from "../geometry/rotation";
import type { Photograph } from "../movingdata/photograph_data";
import type { HeadView } from "../scene/head_view";
import { disposeMesh, photographMesh } from "./drawn_photograph";

const MARK_COLOR = 0x18b6a4;

/** The photograph alone on the stage, in place of the head, so that points can be marked on it. Its axes are taken as x left, y up, z forward; `turn` helps where they are not. */
export class MarkingView {
  private readonly marks = new three.Points(new three.BufferGeometry(), new three.PointsMaterial({ color: MARK_COLOR, size: 9, sizeAttenuation: false, depthTest: false, transparent: true }));
  private readonly group = new three.Group();
  private readonly middle: three.Vector3;

  private constructor(
    private readonly view: HeadView,
    private readonly mesh: Awaited<ReturnType<typeof photographMesh>>,
    sizeMm: number,
  ) {
    mesh.geometry.computeBoundingBox();
    this.middle = mesh.geometry.boundingBox?.getCenter(new three.Vector3()) ?? new three.Vector3();
    // A photograph of unknown scale is drawn as large as a head.
    this.group.scale.setScalar(sizeMm);
    this.marks.renderOrder = 4;
    this.marks.frustumCulled = false;
    this.group.add(mesh, this.marks);
    this.group.visible = false;
    this.place();
    view.stage.scene.add(this.group);
  }

  static async make(view: HeadView, photograph: Photograph): Promise<MarkingView> {
    const mesh = await photographMesh(photograph);
    mesh.geometry.computeBoundingSphere();
    const radius = mesh.geometry.boundingSphere?.radius ?? 1;
    return new MarkingView(view, mesh, radius < 50 || radius > 400 ? 120 / (radius || 1) : 1);
  }

  /** The photograph instead of the head, or the head again. */
  show(isShown: boolean): void {
    this.group.visible = isShown;
    this.view.head.group.visible = !isShown;
    this.view.stage.invalidate();
  }

  /** By a quarter about the axis to the left, as files with z up need it. */
  turn(): void {
    this.group.rotation.x -= Math.PI / 2;
    this.place();
    this.view.stage.invalidate();
  }

  /** The point at a place of the picture, in the page's pixels, in the photograph's axes; null: the photograph is not there. */
  pointAt(x: number, y: number): Vector | null {
    const { clientWidth, clientHeight } = this.view.stage.surface;
    const ray = new three.Raycaster();
    ray.setFromCamera(new three.Vector2((2 * x) / clientWidth - 1, 1 - (2 * y) / clientHeight), this.view.stage.camera);
    this.group.updateMatrixWorld();
    const [hit] = ray.intersectObject(this.mesh, false);
    return hit === undefined ? null : this.group.worldToLocal(hit.point.clone()).toArray();
  }

  showMarks(points: readonly Vector[]): void {
    this.marks.geometry.dispose();
    this.marks.geometry = new three.BufferGeometry();
    this.marks.geometry.setAttribute("position", new three.Float32BufferAttribute(points.flat(), 3));
    this.view.stage.invalidate();
  }

  remove(): void {
    this.show(false);
    this.view.stage.scene.remove(this.group);
    disposeMesh(this.mesh);
    this.marks.geometry.dispose();
    this.marks.material.dispose();
  }

  private place(): void {
    this.group.position.copy(this.middle).applyQuaternion(this.group.quaternion).multiplyScalar(-this.group.scale.x);
  }
}
