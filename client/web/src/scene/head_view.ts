// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import * as three from "three";
import type { Pose } from "../geometry/pose";
import type { Vector } from "../geometry/rotation";
import { type Cut, type DrawnCase, Head } from "./head";
import { SEGMENT_COLORS } from "./materials";
import { Stage, type StageListener } from "./stage";
import { type ViewName, viewDirection } from "./views";

const MARK_COLOR = 0xff3b30;

/** A head on a stage, and how it is looked at: what a planner's page and a follower's page have in common. */
export class HeadView {
  readonly stage: Stage;
  readonly head: Head;
  private readonly marks = new three.Points(
    new three.BufferGeometry(),
    new three.PointsMaterial({ color: MARK_COLOR, size: 6, sizeAttenuation: false, depthTest: false, transparent: true, opacity: 0.85 }),
  );

  constructor(container: HTMLElement, file: DrawnCase, listener: StageListener) {
    this.stage = new Stage(container, listener);
    this.head = new Head(file);
    this.marks.renderOrder = 4;
    this.marks.frustumCulled = false;
    this.marks.visible = false;
    this.head.group.add(this.marks);
    this.stage.scene.add(this.head.group);
    this.look("threeQuarter");
  }

  look(view: ViewName): void {
    this.stage.look(viewDirection(view), this.head.radius);
  }

  setPoses(poses: ReadonlyMap<string, Pose>): void {
    this.head.setPoses(poses);
    this.stage.invalidate();
  }

  setSkinOpacity(opacity: number): void {
    this.head.setSkinOpacity(opacity);
    this.stage.invalidate();
  }

  setGhost(isVisible: boolean): void {
    this.head.setGhost(isVisible);
    this.stage.invalidate();
  }

  setCut(cut: Cut | null): void {
    this.head.setCut(cut);
    this.stage.invalidate();
  }

  /** Points in LPS that are to be looked at. */
  setMarks(points: readonly Vector[]): void {
    const geometry = new three.BufferGeometry();
    geometry.setAttribute("position", new three.Float32BufferAttribute(points.flat(), 3));
    this.marks.geometry.dispose();
    this.marks.geometry = geometry;
    this.marks.visible = points.length > 0;
    this.stage.invalidate();
  }

  /** The segment in the hand glows a little. */
  select(handle: string): void {
    this.head.surfaces.forEach(({ source, mesh }) => {
      if (source.entry.kind !== "segment") return;
      mesh.material.emissive.set(source.entry.handle === handle ? SEGMENT_COLORS[0] : 0);
      mesh.material.emissiveIntensity = 0.12;
    });
    this.stage.invalidate();
  }

  /** The handle of the segment below a point of the canvas, in its pixels; "" for none. */
  segmentAt(x: number, y: number): string {
    const { clientWidth, clientHeight } = this.stage.canvas;
    const ray = new three.Raycaster();
    ray.setFromCamera(new three.Vector2((2 * x) / clientWidth - 1, 1 - (2 * y) / clientHeight), this.stage.camera);
    const meshes = this.head.surfaces.filter(({ source }) => source.entry.handle !== "").map(({ mesh }) => mesh);
    const hit = ray.intersectObjects(meshes, false)[0];
    return hit === undefined ? "" : String(hit.object.userData.handle);
  }
}
