// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Vector } from "../geometry/rotation";
import type { Directions, LabelMap, Volume } from "../volume/volume";
import { MeshCut } from "./mesh_cut";
import { LPS, type Plane, angleDeg, distanceMm } from "./plane_frame";
import { PRESETS, type Window, grayTable } from "./window_level";

/** A surface that is cut with the slice and drawn as a line. An outline that moved is a new object; the same object is not cut again. */
export interface Outline {
  readonly name: string;
  readonly color: string;
  readonly dashed?: boolean;
  /** Not drawn until the user chooses it in the legend. */
  readonly isOptional?: boolean;
  /** #V by 3, LPS, millimeters. */
  readonly positions: Float32Array;
  /** #T by 3. */
  readonly triangles: Uint32Array;
}

export interface DraggablePoint {
  readonly id: string;
  readonly label: string;
  readonly color: string;
  /** LPS, millimeters. */
  position: Vector;
}

export interface DraggablePlane {
  readonly id: string;
  readonly label: string;
  readonly color: string;
  /** LPS, millimeters. */
  point: Vector;
  normal: Vector;
  readonly isLocked?: boolean;
}

/** A distance has two points, an angle three, with the corner second; fewer while it is being placed. */
export interface Measurement {
  readonly kind: "distance" | "angle";
  readonly plane: Plane;
  readonly points: Vector[];
}

/** A box along the axes of LPS, mm. */
export interface Bounds {
  readonly low: Vector;
  readonly high: Vector;
}

export interface CutOutline {
  readonly outline: Outline;
  readonly mesh: MeshCut;
}

/** What all panes show. */
export class SliceScene {
  labels: LabelMap | null = null;
  /** Of each label that is drawn, red in the lowest byte; -1: not drawn. */
  labelRgb = new Int32Array();
  outlines: CutOutline[] = [];
  points: DraggablePoint[] = [];
  planes: DraggablePlane[] = [];
  axes: Directions = LPS;
  crosshair: Vector = [0, 0, 0];
  measurements: Measurement[] = [];
  /** Names of outlines for which the user chose the opposite of how they begin. */
  readonly switched = new Set<string>();
  /** The id of the point or plane that keys move; null: keys move the crosshair. */
  selected: string | null = null;
  private shownVolume: Volume | null = null;
  private knownBounds: Bounds | null | undefined;
  private shownWindow: Window = PRESETS[0].window;
  private grays = grayTable(this.shownWindow);
  /** Blocks of triangles, which stay when vertices move. */
  private readonly cuts = new WeakMap<Uint32Array, MeshCut[]>();

  get volume(): Volume | null {
    return this.shownVolume;
  }

  set volume(volume: Volume | null) {
    this.shownVolume = volume;
    this.knownBounds = undefined;
  }

  get window(): Window {
    return this.shownWindow;
  }

  set window(window: Window) {
    this.shownWindow = window;
    this.grays = grayTable(window);
  }

  get grayTable(): Uint8Array {
    return this.grays;
  }

  setLabels(labels: LabelMap | null, colors: ReadonlyMap<number, string>): void {
    this.labels = labels;
    this.knownBounds = undefined;
    this.labelRgb = new Int32Array(Math.max(0, ...colors.keys()) + 1).fill(-1);
    colors.forEach((color, label) => (this.labelRgb[label] = rgbOf(color)));
  }

  setOutlines(outlines: readonly Outline[]): void {
    this.knownBounds = undefined;
    const before = new Map(this.outlines.map((cut) => [cut.outline, cut]));
    const taken = new Set<MeshCut | undefined>(outlines.map((outline) => before.get(outline)?.mesh));
    this.outlines = outlines.map((outline) => {
      const cut = before.get(outline) ?? { outline, mesh: this.meshOf(outline, taken) };
      taken.add(cut.mesh);
      return cut;
    });
  }

  isDrawn({ name, isOptional }: Outline): boolean {
    return this.switched.has(name) === (isOptional === true);
  }

  /** Of the volume, or else of the labels or the outlines; null where nothing is there. */
  get bounds(): Bounds | null {
    this.knownBounds ??= this.findBounds();
    return this.knownBounds;
  }

  private findBounds(): Bounds | null {
    const [low, high]: [Vector, Vector] = [[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]];
    const take = (positions: ArrayLike<number>) => {
      for (let i = 0; i < positions.length; ++i) {
        const axis = i % 3;
        if (positions[i] < low[axis]) low[axis] = positions[i];
        if (positions[i] > high[axis]) high[axis] = positions[i];
      }
    };
    const grid = this.volume?.grid ?? this.labels?.grid;
    if (grid !== undefined) take(cornersOf(grid).flat());
    else this.outlines.forEach(({ outline }) => take(outline.positions));
    return low[0] > high[0] ? null : { low, high };
  }

  /** Two surfaces with the same triangles, such as skin before and after, have each their own cut: one that is not `taken`. */
  private meshOf({ positions, triangles }: Outline, taken: ReadonlySet<MeshCut | undefined>): MeshCut {
    const known = this.cuts.get(triangles) ?? [];
    const free = known.find((mesh) => !taken.has(mesh));
    if (free !== undefined) {
      free.fit(positions);
      return free;
    }
    const mesh = new MeshCut(positions, triangles);
    this.cuts.set(triangles, [...known, mesh]);
    return mesh;
  }
}

/** Of a CSS color without transparency. */
function rgbOf(color: string): number {
  const context = document.createElement("canvas").getContext("2d");
  if (context === null) return 0xffffff;
  context.fillStyle = color;
  const value = parseInt(String(context.fillStyle).slice(1), 16);
  return ((value & 0xff) << 16) | (value & 0xff00) | (value >> 16);
}

function cornersOf({ size, spacing, origin, directions }: Volume["grid"]): Vector[] {
  const corners: Vector[] = [];
  for (let corner = 0; corner < 8; ++corner) {
    const index = [0, 1, 2].map((axis) => ((corner >> axis) & 1 ? size[axis] - 0.5 : -0.5) * spacing[axis]);
    corners.push([0, 1, 2].map((k) => origin[k] + index[0] * directions[0][k] + index[1] * directions[1][k] + index[2] * directions[2][k]) as Vector);
  }
  return corners;
}

export function isComplete({ kind, points }: Measurement): boolean {
  return points.length === (kind === "distance" ? 2 : 3);
}

/** "23.4 mm" or "112.5°"; empty while points are missing. */
export function measurementText(measurement: Measurement): string {
  if (!isComplete(measurement)) return "";
  const [a, b, c] = measurement.points;
  return measurement.kind === "distance" ? `${distanceMm(a, b).toFixed(1)} mm` : `${angleDeg(a, b, c).toFixed(1)}°`;
}
