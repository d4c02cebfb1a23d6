// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import "../styles/slices.css";
import { type Vector, add, dot, scaled, subtract } from "../geometry/rotation";
import { throttleToFrame } from "../panels/dom";
import type { Directions, LabelMap, Volume } from "../volume/volume";
import { type KeyOwner, PaneKeys } from "./pane_keys";
import { PanePointers } from "./pane_pointers";
import { PLANES, type Plane, planeFrame } from "./plane_frame";
import { SliceControls } from "./slice_controls";
import { SlicePane } from "./slice_pane";
import { type DraggablePlane, type DraggablePoint, type Measurement, type Outline, SliceScene, isComplete, measurementText } from "./slice_scene";

export type { Plane } from "./plane_frame";
export type { DraggablePlane, DraggablePoint, Outline } from "./slice_scene";

/** Receives what a user moves. `isDone`: at the end of a drag, and at each key. */
export interface SliceListener {
  onCrosshair?(point: Vector): void;
  onPoint?(id: string, position: Vector, isDone: boolean): void;
  onPlane?(id: string, point: Vector, normal: Vector, isDone: boolean): void;
}

/** From a slice to the next one where there is no volume. */
const STEP_MM = 1;

/**
 * Axial, coronal and sagittal slices of a volume, with labels, cut surfaces, points and planes over them. Drawn on the page's
 * thread, once before the browser's next picture. All places are LPS, in millimeters.
 */
export class SliceViews {
  /** Three panes, or one at a time on a narrow screen. */
  readonly element: HTMLElement;
  private readonly scene = new SliceScene();
  private readonly controls: SliceControls;
  private readonly panes: readonly SlicePane[];
  private readonly resizes: ResizeObserver;
  private isFitted = false;
  private isDisposed = false;
  private readonly invalidate = throttleToFrame(() => this.draw());

  constructor(private readonly listener: SliceListener) {
    this.panes = PLANES.map((plane) => new SlicePane(plane, this.scene, (mm) => this.slide(plane, mm)));
    this.controls = new SliceControls(this.scene, {
      onChanged: () => this.invalidate(),
      onFit: () => this.fit(),
      onRemove: (measurement) => this.setMeasurements(this.scene.measurements.filter((other) => other !== measurement)),
    }, this.panes.map(({ element }) => element));
    this.element = this.controls.element;
    const owner = this.owner();
    for (const pane of this.panes) {
      new PanePointers(pane, this.scene, owner);
      new PaneKeys(pane, this.scene, owner);
    }
    this.resizes = new ResizeObserver(() => this.resized());
    this.panes.forEach(({ surface }) => this.resizes.observe(surface));
  }

  /** `volume` is not copied. */
  setVolume(volume: Volume | null): void {
    this.scene.volume = volume;
    this.controls.showVolume();
    this.fit();
  }

  /** Half transparent over the slice; labels without a color are not drawn. `labels` is not copied. */
  setLabels(labels: LabelMap | null, colors: ReadonlyMap<number, string>): void {
    this.scene.setLabels(labels, colors);
    this.controls.showLegend(colors);
    this.fitOnce();
  }

  setOutlines(outlines: readonly Outline[]): void {
    this.scene.setOutlines(outlines);
    this.controls.showLegend();
    this.fitOnce();
  }

  setPoints(points: readonly DraggablePoint[]): void {
    this.scene.points = points.map((point) => ({ ...point }));
    this.invalidate();
  }

  setPlanes(planes: readonly DraggablePlane[]): void {
    this.scene.planes = planes.map((plane) => ({ ...plane }));
    this.invalidate();
  }

  /** What "axial" and so on means: unit vectors to the left, posterior and superior, at right angles. LPS by default, or the natural head position. */
  setAxes(axes: Directions): void {
    this.scene.axes = axes;
    this.panes.forEach((pane) => (pane.frame = planeFrame(pane.plane, axes)));
    this.setMeasurements([]);
    this.fit();
  }

  setCrosshair(point: Vector): void {
    this.scene.crosshair = point;
    this.invalidate();
  }

  /** Behind the tools. */
  addControl(control: HTMLElement): void {
    this.controls.add(control);
  }

  dispose(): void {
    this.isDisposed = true;
    this.resizes.disconnect();
    this.panes.forEach((pane) => pane.dispose());
    this.element.remove();
  }

  private owner(): KeyOwner {
    const controls = this.controls;
    return {
      get tool() {
        return controls.tool;
      },
      moveCrosshair: (point) => this.moveCrosshair(point),
      scroll: (pane, slices) => this.moveCrosshair(add(this.scene.crosshair, scaled(pane.frame.normal, slices * this.stepMm(pane.frame.normal)))),
      measure: (pane, point) => this.measure(pane.plane, point),
      changed: () => this.invalidate(),
      onPoint: ({ id, position }, isDone) => this.listener.onPoint?.(id, position, isDone),
      onPlane: ({ id, point, normal }, isDone) => this.listener.onPlane?.(id, point, normal, isDone),
      select: (id) => this.select(id),
      cancelMeasurement: () => this.setMeasurements(this.scene.measurements.filter(isComplete)),
      removeLastMeasurement: () => this.setMeasurements(this.scene.measurements.slice(0, -1)),
    };
  }

  private moveCrosshair(point: Vector): void {
    this.scene.crosshair = this.clamped(point);
    this.invalidate();
    this.listener.onCrosshair?.(this.scene.crosshair);
  }

  /** Within what is shown: a crosshair beyond it would be lost. */
  private clamped(point: Vector): Vector {
    const bounds = this.scene.bounds;
    if (bounds === null) return point;
    return point.map((value, axis) => Math.max(bounds.low[axis], Math.min(bounds.high[axis], value))) as Vector;
  }

  private slide(plane: Plane, mm: number): void {
    const { normal } = planeFrame(plane, this.scene.axes);
    this.moveCrosshair(add(this.scene.crosshair, scaled(normal, mm - dot(this.scene.crosshair, normal))));
  }

  /** The spacing of the volume's axis nearest to this direction. */
  private stepMm(normal: Vector): number {
    const grid = this.scene.volume?.grid;
    if (grid === undefined) return STEP_MM;
    const along = grid.directions.map((direction) => Math.abs(dot(direction, normal)));
    return grid.spacing[along.indexOf(Math.max(...along))];
  }

  private select(id: string | null): void {
    this.scene.selected = id;
    const item = [...this.scene.points, ...this.scene.planes].find((other) => other.id === id);
    this.controls.say(item === undefined ? "" : `Selected: ${item.label}`);
  }

  private measure(plane: Plane, point: Vector): void {
    const { tool } = this.controls;
    if (tool !== "distance" && tool !== "angle") return;
    const measurements = this.scene.measurements;
    const last = measurements.at(-1);
    const isOpen = last !== undefined && !isComplete(last) && last.plane === plane && last.kind === tool;
    const next: Measurement = isOpen ? { ...last, points: [...last.points, point] } : { kind: tool, plane, points: [point] };
    this.setMeasurements([...measurements.filter(isComplete), next]);
    if (isComplete(next)) this.controls.say(measurementText(next));
  }

  private setMeasurements(measurements: Measurement[]): void {
    this.scene.measurements = measurements;
    this.controls.showMeasurements();
    this.invalidate();
  }

  private fit(): void {
    const bounds = this.scene.bounds;
    if (bounds === null) return;
    const isOutside = this.scene.crosshair.some((value, axis) => value < bounds.low[axis] || value > bounds.high[axis]);
    if (isOutside || !this.isFitted) this.moveCrosshair(add(bounds.low, scaled(subtract(bounds.high, bounds.low), 0.5)));
    this.isFitted = true;
    this.panes.forEach((pane) => pane.fit());
    this.invalidate();
  }

  /** Outlines follow a drag: the view stays. */
  private fitOnce(): void {
    if (!this.isFitted) this.fit();
    this.invalidate();
  }

  private resized(): void {
    this.panes.forEach((pane) => pane.resize());
    this.invalidate();
  }

  private draw(): void {
    if (this.isDisposed) return;
    this.controls.showWindow();
    this.panes.forEach((pane) => pane.draw());
  }
}
