// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type Vector, add, apply, cross, dot, fromRotationVector, scaled, subtract } from "../geometry/rotation";
import { ontoPlane } from "./plane_frame";
import { POINT_REACH_MM, planeHandles } from "./slice_overlay";
import type { PaneView } from "./pane_view";
import type { DraggablePlane, DraggablePoint, SliceScene } from "./slice_scene";

/** What a drag does at each place of the pointer, in pixels of the pane. */
export interface Drag {
  move(x: number, y: number): void;
  end(): void;
  /** In place of `end`, where a second finger makes it a pinch: what moved goes back. */
  cancel?(): void;
}

/** Receives items that moved; the item has its new place already. */
export interface ItemListener {
  onPoint(point: DraggablePoint, isDone: boolean): void;
  onPlane(plane: DraggablePlane, isDone: boolean): void;
}

/** A drag of the item at this pixel, which is selected; null where none is within reach. */
export function grabItem(pane: PaneView, scene: SliceScene, x: number, y: number, reachPx: number, listener: ItemListener): Drag | null {
  const point = scene.points.find(({ position }) => isNear(pane.toPixel(position), x, y, reachPx) && depth(pane, scene, position) <= POINT_REACH_MM);
  if (point !== undefined) return pointDrag(pane, scene, point, x, y, listener);
  for (const plane of scene.planes) {
    const drag = plane.isLocked === true ? null : grabPlane(pane, scene, plane, x, y, reachPx, listener);
    if (drag !== null) return drag;
  }
  return null;
}

function isNear([px, py]: readonly [number, number], x: number, y: number, reachPx: number): boolean {
  return Math.hypot(px - x, py - y) <= reachPx;
}

function depth(pane: PaneView, scene: SliceScene, position: Vector): number {
  return Math.abs(dot(subtract(position, scene.crosshair), pane.frame.normal));
}

/** In the slice's plane: the distance of the point from the slice stays. */
function pointDrag(pane: PaneView, scene: SliceScene, { id, position }: DraggablePoint, x: number, y: number, listener: ItemListener): Drag {
  const grip = subtract(position, pane.toPoint(x, y));
  scene.selected = id;
  // The owner may set new points during the drag, so the point is looked up each time.
  const report = (place: Vector | null, isDone: boolean) => {
    const point = scene.points.find((other) => other.id === id);
    if (point === undefined) return;
    if (place !== null) point.position = place;
    listener.onPoint(point, isDone);
  };
  return { move: (toX, toY) => report(add(pane.toPoint(toX, toY), grip), false), end: () => report(null, true) };
}

function grabPlane(pane: PaneView, scene: SliceScene, plane: DraggablePlane, x: number, y: number, reachPx: number, listener: ItemListener): Drag | null {
  const handles = planeHandles(pane, scene, plane);
  if (handles === null) return null;
  if (handles.turns.some((turn) => isNear(turn, x, y, reachPx))) return planeDrag(pane, scene, plane, x, y, turned, listener);
  const [dx, dy] = [x - handles.middle[0], y - handles.middle[1]];
  const fromLine = Math.abs(dx * handles.along[1] - dy * handles.along[0]);
  const isOnHandle = isNear(handles.middle, x, y, reachPx);
  return isOnHandle || fromLine <= reachPx / 2 ? planeDrag(pane, scene, plane, x, y, shifted, listener) : null;
}

type PlaneChange = (pane: PaneView, from: Vector, to: Vector, plane: Pick<DraggablePlane, "point" | "normal">) => Pick<DraggablePlane, "point" | "normal">;

function planeDrag(pane: PaneView, scene: SliceScene, { id, point, normal }: DraggablePlane, x: number, y: number, change: PlaneChange, listener: ItemListener): Drag {
  const from = pane.toPoint(x, y);
  scene.selected = id;
  const report = (to: Vector | null, isDone: boolean) => {
    const plane = scene.planes.find((other) => other.id === id);
    if (plane === undefined) return;
    if (to !== null) Object.assign(plane, change(pane, from, to, { point, normal }));
    listener.onPlane(plane, isDone);
  };
  return { move: (toX, toY) => report(pane.toPoint(toX, toY), false), end: () => report(null, true) };
}

/** Along its normal, so that its line in the slice follows the pointer. */
const shifted: PlaneChange = (_, from, to, { point, normal }) => ({ point: add(point, scaled(normal, dot(normal, subtract(to, from)) / dot(normal, normal))), normal });

/** About the normal of the slice, at the plane's point. */
const turned: PlaneChange = ({ frame }, from, to, { point, normal }) => {
  const center = ontoPlane(point, from, frame.normal);
  const angle = (place: Vector) => Math.atan2(dot(subtract(place, center), frame.down), dot(subtract(place, center), frame.right));
  return { point, normal: turnedNormal(normal, frame.right, frame.down, angle(to) - angle(from)) };
};

/** By `radians` from `right` toward `down`. */
export function turnedNormal(normal: Vector, right: Vector, down: Vector, radians: number): Vector {
  return apply(fromRotationVector(scaled(cross(right, down), radians)), normal);
}
