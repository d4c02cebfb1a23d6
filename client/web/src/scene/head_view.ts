// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import * as three from "three";
import type { SurfaceKind } from "../case/manifest";
import type { Pose } from "../geometry/pose";
import type { Vector } from "../geometry/rotation";
import { type Anchor, corners, nearestWeights } from "../measures/anchor";
import { type Cut, type DrawnCase, type DrawnSurface, Head } from "./head";
import { SEGMENT_COLORS } from "./materials";
import { type PictureSize, Stage, type StageListener } from "./stage";
import { type ViewName, viewDirection } from "./views";

/** Points that are drawn over all else, by what they are. */
const POINT_COLORS = { penetration: 0xff3b30, landmark: 0x18b6a4, suggestion: 0xf2c230, target: 0xe0559b, axis: 0x3f8cff, contact: 0xffffff } as const;
export type PointKind = keyof typeof POINT_COLORS;

/** A head on a stage, and how it is looked at: what a planner's page and a follower's page have in common. */
export class HeadView {
  readonly stage: Stage;
  readonly head: Head;
  private readonly points = new Map<PointKind, three.Points>();

  constructor(container: HTMLElement, file: DrawnCase, listener: StageListener) {
    this.stage = new Stage(container, listener);
    this.head = new Head(file);
    this.stage.scene.add(this.head.group);
    this.look("threeQuarter");
  }

  look(view: ViewName): void {
    const direction = viewDirection(view);
    this.stage.look(direction, this.head.reach(direction));
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

  /** Points in LPS that are to be looked at, instead of those of this kind before. `colors`: red, green and blue of each, 0 to 1, in place of the color of their kind. */
  setPoints(kind: PointKind, positions: readonly Vector[], colors?: Float32Array): void {
    const points = this.points.get(kind) ?? this.addPoints(kind);
    points.geometry.dispose();
    points.geometry = new three.BufferGeometry();
    points.geometry.setAttribute("position", new three.Float32BufferAttribute(positions.flat(), 3));
    if (colors !== undefined) points.geometry.setAttribute("color", new three.BufferAttribute(colors, 3));
    points.visible = positions.length > 0;
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

  /** The handle of the segment below a point of the picture, in the page's pixels; "" if no segment is there. */
  segmentAt(x: number, y: number): string {
    const hit = this.hitAt(x, y, ({ source }) => source.entry.handle !== "");
    return hit === undefined ? "" : String(hit.object.userData.handle);
  }

  /** The point of a surface of these kinds that is seen at a point of the picture, in the page's pixels; null if no such surface is there. Other surfaces in front of it are ignored. */
  anchorAt(x: number, y: number, kinds: readonly SurfaceKind[]): Anchor | null {
    const hit = this.hitAt(x, y, ({ source }) => kinds.includes(source.entry.kind));
    if (hit?.faceIndex == null) return null;
    const surface = this.head.surfaces.findIndex(({ mesh }) => mesh === hit.object);
    const { shape, mesh, source } = this.head.surfaces[surface];
    const at = this.head.group.worldToLocal(hit.point.clone()).applyMatrix4(mesh.matrix.clone().invert());
    const triangle = hit.faceIndex;
    const weights = nearestWeights(at.toArray(), corners({ positions: shape.positions, triangles: source.triangles }, triangle));
    return { surface, triangle, weights };
  }

  /** The head from there, without points and arrows, as Stage.snapshot gives it. */
  portrait(from: ViewName, size: PictureSize): Promise<HTMLCanvasElement | null> {
    return this.stage.snapshot(size, () => {
      const { children } = this.stage.scene;
      const marks = [...children.filter((object) => object !== this.head.group && !(object instanceof three.Light)), ...this.points.values()];
      const hidden = marks.filter(({ visible }) => visible);
      hidden.forEach((object) => (object.visible = false));
      this.look(from);
      return () => hidden.forEach((object) => (object.visible = true));
    });
  }

  private hitAt(x: number, y: number, wanted: (surface: DrawnSurface) => boolean): three.Intersection | undefined {
    const { clientWidth, clientHeight } = this.stage.surface;
    const ray = new three.Raycaster();
    ray.setFromCamera(new three.Vector2((2 * x) / clientWidth - 1, 1 - (2 * y) / clientHeight), this.stage.camera);
    const meshes = this.head.surfaces.filter(wanted).map(({ mesh }) => mesh);
    // Its bounds are those of the face before it moved.
    meshes.forEach((mesh) => mesh.geometry.computeBoundingSphere());
    return ray.intersectObjects(meshes, false).find((hit) => !this.head.isCutOff(hit));
  }

  private addPoints(kind: PointKind): three.Points {
    const material = new three.PointsMaterial({ color: POINT_COLORS[kind], vertexColors: kind === "contact", size: kind === "penetration" ? 6 : 8, sizeAttenuation: false, depthTest: false, transparent: true, opacity: 0.85 });
    const points = new three.Points(new three.BufferGeometry(), material);
    points.renderOrder = 4;
    points.frustumCulled = false;
    this.head.group.add(points);
    this.points.set(kind, points);
    return points;
  }
}
