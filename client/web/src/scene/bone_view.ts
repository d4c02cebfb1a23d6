// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import * as three from "three";
import type { HeadFrame } from "../geometry/pose";
import { headAxes } from "../geometry/pose";
import { type Matrix, type Vector, add, apply, cross, dot, fromRotationVector, norm, scaled, subtract, transpose } from "../geometry/rotation";
import { Gizmo, type GizmoMode, type StageSpace } from "./gizmo";
import { boneMaterial, segmentColor } from "./materials";
import { MovingDetail } from "./moving_detail";
import { Stage, type StageListener, TANGENT } from "./stage";
import { type ViewName, viewDirection } from "./views";

/** A cut, or a plane of reference, as a square about its point. */
export interface ShownPlane {
  readonly id: string;
  /** "#rrggbb" */
  readonly color: string;
  readonly point: Vector;
  readonly normal: Vector;
}

export interface ShownPoint {
  readonly id: string;
  readonly color: string;
  readonly position: Vector;
}

export interface BoneViewListener extends StageListener {
  /** The plane is pulled there; `isDone` when the hand lets go. */
  onPlane(id: string, point: Vector, normal: Vector, isDone: boolean): void;
  /** A click upon bone. LPS, mm. */
  onBone(point: Vector): void;
}

const HALF_PLANE_MM = 45;
const POINT_MM = 1.8;
const CLICK_PX = 4;
const BONE = boneMaterial().color;
/** Of the radius about all bone: its corners are mostly empty. */
const FILLED = 0.8;

/** The preview of a CT's bone with planes and landmarks. Positions are LPS, mm; the stage turns with the head's position. */
export class BoneView {
  readonly stage: Stage;
  private readonly group = new three.Group();
  private readonly marks = new three.Group();
  private readonly space: StageSpace & { worldAxes: Matrix; middle: Vector };
  private readonly gizmo: Gizmo;
  private bone: three.Mesh<three.BufferGeometry, three.MeshStandardMaterial> | null = null;
  private detail: MovingDetail | null = null;
  private radius = 100;
  private planes: readonly ShownPlane[] = [];
  private selected: ShownPlane | null = null;
  private downAt: [number, number] | null = null;

  constructor(container: HTMLElement, private readonly listener: BoneViewListener) {
    this.stage = new Stage(container, listener);
    this.group.matrixAutoUpdate = false;
    this.stage.scene.add(this.group);
    this.group.add(this.marks);
    const middle: Vector = [0, 0, 0];
    this.space = {
      worldAxes: [1, 0, 0, 0, 0, 1, 0, -1, 0],
      middle,
      toWorld: (point) => new three.Vector3(...apply(this.space.worldAxes, subtract(point, this.space.middle))),
    };
    this.gizmo = new Gizmo(this.stage, this.space, ({ rotationVector, pivotMm, translationMm }, isDone) => {
      if (this.selected === null) return;
      const normal = apply(fromRotationVector(rotationVector), this.selected.normal);
      this.listener.onPlane(this.selected.id, add(pivotMm, translationMm), normal, isDone);
    });
    this.gizmo.hide("no plane", true);
    this.stage.controls.addEventListener("change", () => this.detail?.move());
    this.listenForClicks();
  }

  /** Of all bone, 3 numbers for each vertex. `coarse`: fewer triangles of the same vertices, for while something moves. */
  setBone(positions: Float32Array, triangles: Uint32Array, coarse: Uint32Array): void {
    if (this.bone !== null) this.group.remove(this.bone);
    this.bone?.geometry.dispose();
    this.detail?.dispose();
    const geometry = new three.BufferGeometry();
    geometry.setAttribute("position", new three.BufferAttribute(positions, 3));
    geometry.setAttribute("color", new three.BufferAttribute(new Float32Array(positions.length).fill(1), 3));
    geometry.setIndex(new three.BufferAttribute(triangles, 1));
    geometry.computeVertexNormals();
    this.detail = new MovingDetail(this.stage, geometry, triangles, coarse);
    const material = boneMaterial();
    material.vertexColors = true;
    material.color.set(0xffffff);
    this.bone = new three.Mesh(geometry, material);
    this.group.add(this.bone);
    this.colorBone(new Uint8Array(positions.length / 3).fill(1));
    geometry.computeBoundingSphere();
    const sphere = geometry.boundingSphere ?? new three.Sphere();
    this.space.middle = sphere.center.toArray();
    this.radius = Math.max(20, sphere.radius);
    this.place();
    this.look("threeQuarter");
  }

  /** Of each vertex: 1 bone that stays, 2, 3, .. the segments. */
  colorBone(labels: Uint8Array): void {
    const attribute = this.bone?.geometry.attributes.color as three.BufferAttribute | undefined;
    if (attribute === undefined) return;
    const colors = Array.from({ length: 256 }, (_, label) => (label < 2 ? BONE : new three.Color(segmentColor(label - 2))));
    const array = attribute.array as Float32Array;
    for (let vertex = 0, at = 0; vertex < labels.length; ++vertex, at += 3) colors[labels[vertex]].toArray(array, at);
    attribute.needsUpdate = true;
    this.changed();
  }

  /** Turns the view, not the data. */
  setFrame(frame: HeadFrame): void {
    const axes = headAxes(frame);
    this.space.worldAxes = [...axes.slice(0, 3), ...axes.slice(6, 9), -axes[3], -axes[4], -axes[5]];
    this.place();
  }

  look(view: ViewName): void {
    const reach = (FILLED * this.radius) / TANGENT;
    this.stage.look(viewDirection(view), { height: reach, width: reach });
  }

  /** Does not interrupt a plane that is being pulled. `isHeld`: a hand holds one of them, here or elsewhere. */
  setMarks(planes: readonly ShownPlane[], points: readonly ShownPoint[], selected: string | null, isHeld: boolean): void {
    if (this.detail !== null) this.detail.isHeld = isHeld;
    this.planes = planes;
    this.marks.children.forEach((mark) => (mark as three.Mesh).geometry.dispose());
    this.marks.clear();
    for (const plane of planes) this.marks.add(planeMesh(plane, plane.id === selected));
    for (const point of points) this.marks.add(pointMesh(point));
    if (!this.gizmo.isDragging) this.select(selected);
    this.changed();
  }

  setGizmoMode(mode: GizmoMode): void {
    this.gizmo.setMode(mode);
  }

  dispose(): void {
    this.gizmo.dispose();
    this.detail?.dispose();
    this.bone?.geometry.dispose();
    this.stage.dispose();
  }

  private select(id: string | null): void {
    this.selected = this.planes.find((plane) => plane.id === id) ?? null;
    this.gizmo.hide("no plane", this.selected === null);
    if (this.selected !== null) this.gizmo.place({ rotationVector: [0, 0, 0], pivotMm: this.selected.point, translationMm: [0, 0, 0], scale: 1 });
  }

  private place(): void {
    const [a, b, c, d, e, f, g, h, i] = this.space.worldAxes;
    const [x, y, z] = apply(this.space.worldAxes, this.space.middle);
    this.group.matrix.set(a, b, c, -x, d, e, f, -y, g, h, i, -z, 0, 0, 0, 1);
    this.group.matrixWorldNeedsUpdate = true;
    this.select(this.selected?.id ?? null);
    this.changed();
  }

  private changed(): void {
    if (this.detail === null) this.stage.invalidate();
    else this.detail.move();
  }

  private listenForClicks(): void {
    const { surface } = this.stage;
    surface.addEventListener("pointerdown", (event) => (this.downAt = [event.clientX, event.clientY]));
    surface.addEventListener("pointerup", (event) => {
      const isClick = this.downAt !== null && Math.hypot(event.clientX - this.downAt[0], event.clientY - this.downAt[1]) <= CLICK_PX;
      if (isClick && event.button === 0 && !this.gizmo.isTouched) this.clickAt(event.clientX, event.clientY);
    });
  }

  private clickAt(clientX: number, clientY: number): void {
    if (this.bone === null) return;
    const { left, top, width, height } = this.stage.surface.getBoundingClientRect();
    const place = new three.Vector3((2 * (clientX - left)) / width - 1, 1 - (2 * (clientY - top)) / height, 0.5).unproject(this.stage.camera);
    const ray = new three.Raycaster(this.stage.camera.position, place.sub(this.stage.camera.position).normalize());
    const hit = ray.intersectObject(this.bone)[0];
    if (hit === undefined) return;
    const { worldAxes, middle } = this.space;
    this.listener.onBone(add(apply(transpose(worldAxes), hit.point.toArray()), middle));
  }
}

function planeMesh({ point, normal, color }: ShownPlane, isSelected: boolean): three.Mesh {
  const n = scaled(normal, 1 / norm(normal));
  const helper: Vector = Math.abs(n[2]) < 0.9 ? [0, 0, 1] : [0, 1, 0];
  const across = subtract(helper, scaled(n, dot(helper, n)));
  const u = scaled(across, HALF_PLANE_MM / norm(across));
  const v = cross(n, u);
  const corners = [add(u, v), subtract(v, u), scaled(add(u, v), -1), subtract(u, v)].map((corner) => add(point, corner));
  const material = new three.MeshBasicMaterial({ color, transparent: true, opacity: isSelected ? 0.5 : 0.25, side: three.DoubleSide, depthWrite: false });
  return new three.Mesh(geometryOf(corners, [0, 1, 2, 0, 2, 3]), material);
}

/** An octahedron: small enough, and of few triangles. */
function pointMesh({ position, color }: ShownPoint): three.Mesh {
  const axes: Vector[] = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]];
  const corners = axes.map((axis) => add(position, scaled(axis, POINT_MM)));
  const faces = [0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4, 2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5];
  return new three.Mesh(geometryOf(corners, faces), new three.MeshBasicMaterial({ color, depthTest: false, transparent: true }));
}

function geometryOf(corners: readonly Vector[], faces: readonly number[]): three.BufferGeometry {
  const geometry = new three.BufferGeometry();
  geometry.setAttribute("position", new three.BufferAttribute(Float32Array.from(corners.flat()), 3));
  geometry.setIndex(new three.BufferAttribute(Uint32Array.from(faces), 1));
  return geometry;
}
