// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type Vector, add, dot, scaled, subtract } from "../geometry/rotation";
import type { SliceLines } from "./mesh_cut";
import { lineInSlice } from "./plane_frame";
import type { PaneView } from "./pane_view";
import { type DraggablePlane, type DraggablePoint, type Measurement, type SliceScene, isComplete, measurementText } from "./slice_scene";

/** Points farther from the slice are not drawn. */
export const POINT_REACH_MM = 10;
const POINT_IN_SLICE_MM = 1.5;
/** A measurement is drawn on slices as near to its own. */
const MEASUREMENT_REACH_MM = 1;
/** From the middle of a plane to the handles that turn it, in pixels. */
export const TURN_HANDLE_PX = 70;
const CROSSHAIR_GAP_PX = 6;
const MEASUREMENT_COLOR = "#ffe14d";
const CROSSHAIR_COLOR = "#5fd0f0";
const FAR_PX = 4000;
/** A dark line below each drawn one keeps it visible on white bone. */
const SHADOW = "rgb(0 0 0 / 65%)";

/** Draws what is over a slice: outlines, cut planes, points, measurements, crosshair. */
export function drawOverlay(canvas: HTMLCanvasElement, pane: PaneView, scene: SliceScene, lines: SliceLines): void {
  const context = canvas.getContext("2d");
  if (context === null) return;
  const ratio = Math.min(2, devicePixelRatio);
  const [width, height] = [Math.round(pane.width * ratio), Math.round(pane.height * ratio)];
  if (canvas.width !== width) canvas.width = width;
  if (canvas.height !== height) canvas.height = height;
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, pane.width, pane.height);
  context.font = "12px system-ui, sans-serif";
  context.lineJoin = "round";
  drawCrosshair(context, pane, scene.crosshair);
  const drawn = scene.outlines.filter(({ outline }) => scene.isDrawn(outline));
  const cuts = lines.of(drawn.map(({ mesh }) => mesh), scene.crosshair, pane.frame.normal);
  drawn.forEach(({ outline }, index) => drawLines(context, pane, cuts[index], outline.color, outline.dashed === true));
  for (const plane of scene.planes) drawPlane(context, pane, scene, plane);
  for (const point of scene.points) drawPoint(context, pane, scene, point);
  for (const measurement of scene.measurements) if (measurement.plane === pane.plane) drawMeasurement(context, pane, scene, measurement);
}

function drawLines(context: CanvasRenderingContext2D, pane: PaneView, lines: readonly Float32Array[], color: string, isDashed: boolean): void {
  const path = new Path2D();
  for (const line of lines) {
    for (let i = 0; i < line.length; i += 3) {
      const [x, y] = pane.toPixel([line[i], line[i + 1], line[i + 2]]);
      if (i === 0) path.moveTo(x, y);
      else path.lineTo(x, y);
    }
  }
  context.setLineDash(isDashed ? [6, 4] : []);
  stroke(context, path, color, 1.5);
  context.setLineDash([]);
}

function stroke(context: CanvasRenderingContext2D, path: Path2D, color: string, width: number): void {
  context.strokeStyle = SHADOW;
  context.lineWidth = width + 2;
  context.stroke(path);
  context.strokeStyle = color;
  context.lineWidth = width;
  context.stroke(path);
}

function drawText(context: CanvasRenderingContext2D, text: string, x: number, y: number, color: string): void {
  context.lineWidth = 3;
  context.strokeStyle = "#000000";
  context.strokeText(text, x, y);
  context.fillStyle = color;
  context.fillText(text, x, y);
}

function drawCrosshair(context: CanvasRenderingContext2D, pane: PaneView, crosshair: Vector): void {
  const [x, y] = pane.toPixel(crosshair);
  const path = new Path2D();
  for (const [from, to] of [[-FAR_PX, -CROSSHAIR_GAP_PX], [CROSSHAIR_GAP_PX, FAR_PX]]) {
    path.moveTo(x + from, y);
    path.lineTo(x + to, y);
    path.moveTo(x, y + from);
    path.lineTo(x, y + to);
  }
  context.strokeStyle = CROSSHAIR_COLOR;
  context.lineWidth = 1;
  context.globalAlpha = 0.7;
  context.stroke(path);
  context.globalAlpha = 1;
}

/** Where a plane's line and its handles are, in pixels; null where the plane does not cross the slice. */
export function planeHandles(pane: PaneView, scene: SliceScene, { point, normal }: DraggablePlane): { middle: [number, number]; along: [number, number]; turns: [number, number][] } | null {
  const line = lineInSlice(point, normal, scene.crosshair, pane.frame.normal);
  if (line === null) return null;
  const middle = pane.toPixel(line.at);
  const along: [number, number] = [dot(line.along, pane.frame.right), dot(line.along, pane.frame.down)];
  const turns = [-TURN_HANDLE_PX, TURN_HANDLE_PX].map((px): [number, number] => [middle[0] + px * along[0], middle[1] + px * along[1]]);
  return { middle, along, turns };
}

function drawPlane(context: CanvasRenderingContext2D, pane: PaneView, scene: SliceScene, plane: DraggablePlane): void {
  const handles = planeHandles(pane, scene, plane);
  if (handles === null) return;
  const { middle: [x, y], along: [dx, dy], turns } = handles;
  const path = new Path2D();
  path.moveTo(x - FAR_PX * dx, y - FAR_PX * dy);
  path.lineTo(x + FAR_PX * dx, y + FAR_PX * dy);
  stroke(context, path, plane.color, plane.id === scene.selected ? 3 : 1.5);
  if (plane.isLocked !== true) {
    const marks = new Path2D();
    marks.rect(x - 5, y - 5, 10, 10);
    for (const [turnX, turnY] of turns) {
      marks.moveTo(turnX + 5, turnY);
      marks.arc(turnX, turnY, 5, 0, 2 * Math.PI);
    }
    stroke(context, marks, plane.color, 1.5);
  }
  drawText(context, plane.label, x + 10, y - 10, plane.color);
}

function drawPoint(context: CanvasRenderingContext2D, pane: PaneView, scene: SliceScene, point: DraggablePoint): void {
  const far = Math.abs(dot(subtract(point.position, scene.crosshair), pane.frame.normal));
  if (far > POINT_REACH_MM) return;
  const [x, y] = pane.toPixel(point.position);
  const circle = new Path2D();
  circle.arc(x, y, point.id === scene.selected ? 7 : 5, 0, 2 * Math.PI);
  stroke(context, circle, point.color, 1.5);
  context.fillStyle = point.color;
  if (far <= POINT_IN_SLICE_MM) context.fill(circle);
  drawText(context, point.label, x + 9, y + 4, point.color);
}

function drawMeasurement(context: CanvasRenderingContext2D, pane: PaneView, scene: SliceScene, measurement: Measurement): void {
  const { points } = measurement;
  const far = Math.abs(dot(subtract(points[0], scene.crosshair), pane.frame.normal));
  if (far > MEASUREMENT_REACH_MM) return;
  const path = new Path2D();
  points.map((point) => pane.toPixel(point)).forEach(([x, y], index) => {
    if (index === 0) path.moveTo(x, y);
    else path.lineTo(x, y);
    path.rect(x - 2, y - 2, 4, 4);
    path.moveTo(x, y);
  });
  stroke(context, path, MEASUREMENT_COLOR, 1.5);
  if (!isComplete(measurement)) return;
  const middle = measurement.kind === "angle" ? points[1] : scaled(add(points[0], points[1]), 0.5);
  const [x, y] = pane.toPixel(middle);
  drawText(context, measurementText(measurement), x + 8, y - 8, MEASUREMENT_COLOR);
}
