// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import * as three from "three";
import type { CaseSurface } from "../case/case_file";
import type { Manifest } from "../case/manifest";
import { FollowingSurface, vertexNormals } from "../geometry/following_surface";
import { type Pose, headAxes } from "../geometry/pose";
import { type Matrix, type Vector, apply, fromRotationVector, subtract, transpose } from "../geometry/rotation";
import { SKIN_COLOR, boneMaterial, depthMaterial, ghostMaterial, segmentMaterial, skinMaterial, teethMaterial } from "./materials";
import { type Reach, TANGENT } from "./stage";

const WHITE = new three.Color(0xffffff);

/** What is drawn of a case. */
export interface DrawnCase {
  manifest: Pick<Manifest, "handles" | "headFrame">;
  surfaces: CaseSurface[];
}

/** A surface of the case with what is drawn for it. */
export interface DrawnSurface {
  source: CaseSurface;
  shape: FollowingSurface;
  mesh: three.Mesh<three.BufferGeometry, three.MeshStandardMaterial>;
}

/** Where the skin is cut: off what lies beyond `atMm` along an axis of the world. */
export interface Cut {
  axis: "x" | "y" | "z";
  atMm: number;
}

/**
 * The head of a case: its surfaces below one group that turns LPS into the stage's axes. Positions and normals of what follows are
 * written straight into the arrays of the geometry.
 */
export class Head {
  readonly group = new three.Group();
  readonly surfaces: DrawnSurface[];
  readonly skins: DrawnSurface[];
  /** Of all that is drawn, about the middle, in mm. */
  readonly radius: number;
  /** Rows are left, superior, anterior. */
  readonly worldAxes: Matrix;
  readonly middle: Vector;

  private readonly depth = depthMaterial();
  private readonly skin = skinMaterial();
  private readonly ghosts = new three.Group();
  private readonly middles = new Map<string, Vector>();
  private readonly cutPlane = new three.Plane();

  constructor(private readonly file: DrawnCase) {
    const axes = headAxes(file.manifest.headFrame);
    this.worldAxes = [...axes.slice(0, 3), ...axes.slice(6, 9), -axes[3], -axes[4], -axes[5]];
    const bounds = boundsOf(file.surfaces);
    this.middle = bounds.getCenter(new three.Vector3()).toArray();
    this.radius = 0.5 * bounds.getSize(new three.Vector3()).length() * 0.8;
    this.surfaces = file.surfaces.map((surface) => this.add(surface));
    this.skins = this.surfaces.filter((surface) => surface.source.entry.kind === "skin");
    this.skins.forEach((skin) => this.addLayers(skin));
    this.ghosts.visible = false;
    this.group.add(this.ghosts);
    this.group.matrixAutoUpdate = false;
    this.group.matrix.copy(this.worldMatrix());
    this.colorSkin(null);
  }

  /** Three of each entry of the list that surfaces follow (CaseFile.followed), in mm. */
  setDisplacements(displacements: Float32Array): void {
    for (const { shape, mesh, source } of this.surfaces) {
      if (source.follows === null) continue;
      shape.move(displacements);
      mesh.geometry.attributes.position.needsUpdate = true;
      mesh.geometry.attributes.normal.needsUpdate = true;
    }
  }

  /** By handle; segments that are not named are at rest. */
  setPoses(poses: ReadonlyMap<string, Pose>): void {
    for (const { source, mesh } of this.surfaces) {
      if (source.entry.handle === "") continue;
      const pose = poses.get(source.entry.handle);
      mesh.matrix.copy(pose === undefined ? new three.Matrix4() : poseMatrix(pose));
      mesh.matrixWorldNeedsUpdate = true;
    }
  }

  setSkinOpacity(opacity: number): void {
    const isTransparent = opacity < 1;
    if (this.skin.transparent !== isTransparent) {
      this.skin.transparent = isTransparent;
      this.skin.needsUpdate = true;
    }
    this.skin.opacity = opacity;
    this.skin.depthWrite = !isTransparent;
    this.depth.visible = isTransparent && opacity > 0;
    this.skin.visible = opacity > 0;
  }

  setGhost(isVisible: boolean): void {
    this.ghosts.visible = isVisible;
  }

  /** Null: whole. Bone is not cut. */
  setCut(cut: Cut | null): void {
    const planes = cut === null ? null : [this.cutPlane];
    if (cut !== null) {
      const normal = new three.Vector3();
      normal[cut.axis] = -1;
      this.cutPlane.set(normal, cut.atMm);
    }
    this.skin.clippingPlanes = planes;
    this.depth.clippingPlanes = planes;
  }

  /** A point of the skin that the cut has taken off. */
  isCutOff({ object, point }: three.Intersection): boolean {
    const isSkin = this.skins.some(({ mesh }) => mesh === object);
    return isSkin && this.skin.clippingPlanes !== null && this.skin.clippingPlanes.length > 0 && this.cutPlane.distanceToPoint(point) < 0;
  }

  /** Three bytes of each vertex of each of `skins`, sRGB; null: the color of skin. */
  colorSkin(colors: Uint8Array[] | null): void {
    this.skins.forEach(({ mesh }, index) => {
      const attribute = mesh.geometry.attributes.color as three.BufferAttribute;
      const array = attribute.array as Float32Array;
      if (colors === null) for (let i = 0; i < array.length; i += 3) SKIN_COLOR.toArray(array, i);
      else toLinear(colors[index], array);
      attribute.needsUpdate = true;
    });
  }

  /** Three bytes of each vertex of each surface of these, sRGB; null: as they look. */
  colorSurfaces(surfaces: readonly DrawnSurface[], colors: Uint8Array[] | null): void {
    surfaces.forEach(({ mesh, source }, index) => {
      if (mesh.geometry.attributes.color === undefined) mesh.geometry.setAttribute("color", dynamic(new three.BufferAttribute(new Float32Array(source.positions.length), 3)));
      const attribute = mesh.geometry.attributes.color as three.BufferAttribute;
      if (colors !== null) toLinear(colors[index], attribute.array as Float32Array);
      attribute.needsUpdate = true;
      if (mesh.material.vertexColors === (colors !== null)) return;
      mesh.material.vertexColors = colors !== null;
      mesh.material.color.copy(colors === null ? this.material(source).color : WHITE);
      mesh.material.needsUpdate = true;
    });
  }

  /** Teeth alone, or all. */
  setTeethOnly(isOnly: boolean): void {
    this.group.children.forEach((child) => {
      const surface = this.surfaces.find(({ mesh }) => mesh === child);
      if (surface !== undefined) child.visible = !isOnly || surface.source.entry.kind === "teeth";
    });
    this.depth.visible = !isOnly && this.skin.transparent && this.skin.opacity > 0;
  }

  /** From LPS to the stage. */
  toWorld(point: Vector): three.Vector3 {
    return new three.Vector3(...apply(this.worldAxes, subtract(point, this.middle)));
  }

  /** Of all that is drawn, seen from `direction` of the stage. */
  reach(direction: three.Vector3): Reach {
    const toward = direction.clone().normalize();
    const right = new three.Vector3(0, 1, 0).cross(toward).normalize();
    const axes = [right, toward.clone().cross(right), toward].map((axis) => apply(transpose(this.worldAxes), axis.toArray()));
    const reach = { height: 1, width: 1 };
    for (const { shape } of this.surfaces) {
      for (let i = 0; i < shape.positions.length; i += 3) {
        const [x, y, z] = axes.map((axis) => this.along(axis, shape.positions, i));
        reach.width = Math.max(reach.width, z + Math.abs(x) / TANGENT);
        reach.height = Math.max(reach.height, z + Math.abs(y) / TANGENT);
      }
    }
    return reach;
  }

  /** The middle of a segment's surfaces at rest, LPS; null where it has none. */
  segmentMiddle(handle: string): Vector | null {
    const known = this.middles.get(handle);
    if (known !== undefined) return known;
    const bounds = boundsOf(this.file.surfaces.filter(({ entry }) => entry.kind === "segment" && entry.handle === handle));
    if (bounds.isEmpty()) return null;
    const middle: Vector = bounds.getCenter(new three.Vector3()).toArray();
    this.middles.set(handle, middle);
    return middle;
  }

  /** Frees what the graphics card holds. */
  dispose(): void {
    this.group.traverse((object) => {
      if (object instanceof three.Mesh) {
        object.geometry.dispose();
        (object.material as three.Material).dispose();
      }
    });
  }

  /** How far a position lies from the middle along an axis of LPS. */
  private along(axis: Vector, positions: Float32Array, i: number): number {
    return axis[0] * (positions[i] - this.middle[0]) + axis[1] * (positions[i + 1] - this.middle[1]) + axis[2] * (positions[i + 2] - this.middle[2]);
  }

  private worldMatrix(): three.Matrix4 {
    const [a, b, c, d, e, f, g, h, i] = this.worldAxes;
    const [x, y, z] = apply(this.worldAxes, this.middle);
    return new three.Matrix4(a, b, c, -x, d, e, f, -y, g, h, i, -z, 0, 0, 0, 1);
  }

  private add(source: CaseSurface): DrawnSurface {
    const shape = new FollowingSurface(source.positions, source.triangles, source.follows);
    const geometry = new three.BufferGeometry();
    geometry.setAttribute("position", dynamic(new three.BufferAttribute(shape.positions, 3)));
    geometry.setAttribute("normal", dynamic(new three.BufferAttribute(shape.normals, 3)));
    geometry.setIndex(new three.BufferAttribute(source.triangles, 1));
    if (source.entry.kind === "skin") {
      geometry.setAttribute("color", dynamic(new three.BufferAttribute(new Float32Array(source.positions.length), 3)));
    }
    const mesh = new three.Mesh(geometry, this.material(source));
    mesh.name = source.entry.name;
    mesh.userData.handle = source.entry.handle;
    mesh.matrixAutoUpdate = false;
    mesh.frustumCulled = false;
    this.group.add(mesh);
    return { source, shape, mesh };
  }

  private material({ entry }: CaseSurface): three.MeshStandardMaterial {
    if (entry.kind === "skin") return this.skin;
    if (entry.kind === "teeth") return teethMaterial();
    if (entry.kind === "bone") return boneMaterial();
    return segmentMaterial(this.file.manifest.handles.findIndex((handle) => handle.name === entry.handle));
  }

  private addLayers({ source, mesh }: DrawnSurface): void {
    mesh.renderOrder = 2;
    const depth = new three.Mesh(mesh.geometry, this.depth);
    depth.renderOrder = 1;
    depth.matrixAutoUpdate = false;
    depth.frustumCulled = false;
    this.depth.visible = false;
    const geometry = new three.BufferGeometry();
    geometry.setAttribute("position", new three.BufferAttribute(source.positions, 3));
    geometry.setAttribute("normal", new three.BufferAttribute(vertexNormals(source.positions, source.triangles), 3));
    geometry.setIndex(mesh.geometry.index);
    const ghost = new three.Mesh(geometry, ghostMaterial());
    ghost.renderOrder = 3;
    ghost.matrixAutoUpdate = false;
    this.ghosts.add(ghost);
    this.group.add(depth);
  }
}

/** x = pivot + scale R (v - pivot) + translation, as a matrix of the surface in LPS. */
export function poseMatrix(pose: Pose): three.Matrix4 {
  const m = fromRotationVector(pose.rotationVector).map((entry) => entry * pose.scale);
  const turned = apply(m, pose.pivotMm);
  const [x, y, z] = [0, 1, 2].map((k) => pose.pivotMm[k] - turned[k] + pose.translationMm[k]);
  return new three.Matrix4(m[0], m[1], m[2], x, m[3], m[4], m[5], y, m[6], m[7], m[8], z, 0, 0, 0, 1);
}

function dynamic(attribute: three.BufferAttribute): three.BufferAttribute {
  return attribute.setUsage(three.DynamicDrawUsage);
}

function boundsOf(surfaces: readonly CaseSurface[]): three.Box3 {
  const bounds = new three.Box3();
  const point = new three.Vector3();
  for (const { positions } of surfaces) {
    for (let i = 0; i < positions.length; i += 3) bounds.expandByPoint(point.fromArray(positions, i));
  }
  return bounds;
}

const LINEAR = Float32Array.from({ length: 256 }, (_, value) => {
  const share = value / 255;
  return share <= 0.04045 ? share / 12.92 : ((share + 0.055) / 1.055) ** 2.4;
});

/** Bytes of sRGB as linear numbers, 0 to 1. */
export function toLinear(colors: Uint8Array, out: Float32Array): void {
  for (let i = 0; i < out.length; ++i) out[i] = LINEAR[colors[i]];
}
