// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { HeadFrame } from "../geometry/pose";
import { type Vector, scaled } from "../geometry/rotation";
import { History } from "../planning/history";
import type { LabelMap, Volume } from "../volume/volume";
import { axesGrid } from "./file_axes";
import { LANDMARKS, anatomyOf, headFrameOf, occlusalPlaneOf } from "./jaw_planes";
import type { PieceCut } from "./pieces";
import { EMPTY_RECIPE, type Plane, type Recipe, hasPoint, parseDraft, recipeText, rounded, roundedPlane, withSegment, withValue } from "./recipe";

/** A plane that can be dragged, under a name of the page: "cut 0 1", "occlusal", "horizontal", "midsagittal". */
export interface NamedPlane {
  readonly id: string;
  readonly label: string;
  readonly plane: Plane;
  /** Of the segment that it cuts; -1 for a plane of reference. */
  readonly segment: number;
}

export const REFERENCES = [
  { id: "occlusal", label: "Occlusal plane", path: ["occlusal_plane"] },
  { id: "horizontal", label: "Frankfort horizontal", path: ["head_frame", "horizontal"] },
  { id: "midsagittal", label: "Midsagittal plane", path: ["head_frame", "midsagittal"] },
] as const;

export type ReferenceId = (typeof REFERENCES)[number]["id"];

const STORAGE_KEY = "tissueform-recipe";

/**
 * What is being planned: the recipe with all that was before, and the CT that it is of. The recipe holds places and numbers, nothing
 * of the patient's identity, and stays in the tab through a reload; the CT stays in memory alone.
 */
export class PlanDraft {
  /** As it was read; this is what is sent. */
  source: Volume | null = null;
  /** As slices show it: in HU and in the patient's axes, where the recipe says what the file does not. */
  shown: Volume | null = null;
  labels: LabelMap | null = null;
  /** Name of the draft on the server whose CT this is; null: the CT was dropped. */
  received: string | null = null;
  crosshair: Vector = [0, 0, 0];
  selectedSegment = 0;
  selectedPlane: string | null = null;

  private history: History<Recipe>;
  private preview: Recipe | null = null;
  private readonly listeners: ((draft: PlanDraft) => void)[] = [];

  constructor(private readonly storage: Pick<Storage, "getItem" | "setItem"> | null = null) {
    this.history = new History(this.stored());
  }

  get recipe(): Recipe {
    return this.preview ?? this.history.now;
  }

  /** In the middle of a drag. */
  get isHeld(): boolean {
    return this.preview !== null;
  }

  get canUndo(): boolean {
    return this.history.canUndo;
  }

  get frame(): HeadFrame {
    return headFrameOf(this.recipe);
  }

  get occlusal(): Plane | null {
    return occlusalPlaneOf(this.recipe);
  }

  /** Where a landmark is or may be; the edge of the upper incisors is at the crosshair unless it was placed. */
  get anatomy(): (name: string) => Vector {
    return anatomyOf(this.recipe, this.crosshair);
  }

  watch(listener: (draft: PlanDraft) => void): void {
    this.listeners.push(listener);
    listener(this);
  }

  /** A change that is not final is a step of a drag. */
  change(recipe: Recipe, isFinal = true): void {
    this.preview = isFinal ? null : recipe;
    if (isFinal) this.keep(recipe);
    this.notify();
  }

  undo(): void {
    this.preview = null;
    this.history.undo();
    this.store();
    this.notify();
  }

  select(segment: number, plane: string | null): void {
    this.selectedSegment = segment;
    this.selectedPlane = plane;
    this.notify();
  }

  setCrosshair(point: Vector): void {
    this.crosshair = point;
  }

  setVolume(volume: Volume, labels: LabelMap | null, received: string | null = null): void {
    this.source = volume;
    this.labels = labels;
    this.received = received;
    this.showVolume();
    const { grid } = this.shown as Volume;
    this.crosshair = rounded(middleOf(grid));
    this.notify();
  }

  /** What slices show; a copy of the values only where the recipe shifts them. */
  showVolume(): void {
    if (this.source === null) return;
    const { hu_offset: offset = 0, axes } = this.recipe.ct ?? {};
    const grid = axes === undefined ? this.source.grid : axesGrid(this.source.grid, axes);
    const values = offset === 0 ? this.source.values : this.source.values.map((value) => value + offset);
    this.shown = { ...this.source, grid, values };
  }

  /** Planes of the recipe that have a place, cuts first. */
  get planes(): NamedPlane[] {
    const cuts = this.recipe.segments.flatMap(({ planes = [] }, segment) =>
      planes.flatMap((plane, index) => (hasPoint(plane) ? [{ id: `cut ${segment} ${index}`, label: `Plane ${index + 1}`, plane, segment }] : [])),
    );
    const references = REFERENCES.flatMap(({ id, label }) => {
      const plane = this.reference(id);
      return plane === null ? [] : [{ id, label, plane, segment: -1 }];
    });
    return [...cuts, ...references];
  }

  reference(id: ReferenceId): Plane | null {
    const { occlusal_plane, head_frame } = this.recipe;
    const plane = id === "occlusal" ? occlusal_plane : head_frame?.[id];
    return hasPoint(plane) ? plane : null;
  }

  /** Null: as the build finds it. */
  setReference(id: ReferenceId, plane: Plane | null, isFinal = true): void {
    const path = REFERENCES.find((entry) => entry.id === id)?.path ?? [];
    this.change(withValue(this.recipe, path, plane === null ? undefined : roundedPlane(plane)), isFinal);
  }

  movePlane(id: string, plane: Plane, isFinal: boolean): void {
    const match = /^cut (\d+) (\d+)$/.exec(id);
    if (match === null) return this.setReference(id as ReferenceId, plane, isFinal);
    const [segment, index] = [Number(match[1]), Number(match[2])];
    const planes = (this.recipe.segments[segment]?.planes ?? []).map((old, at) => (at === index ? roundedPlane(plane) : old));
    this.change(withSegment(this.recipe, segment, { planes }), isFinal);
  }

  /** Undefined: as the build finds it. */
  setLandmark(name: string, point: Vector | undefined, isFinal = true): void {
    this.change(withValue(this.recipe, ["landmarks", "points_mm", name], point === undefined ? undefined : rounded(point)), isFinal);
  }

  get landmarks(): { name: string; label: string; position: Vector }[] {
    const placed = this.recipe.landmarks?.points_mm ?? {};
    return LANDMARKS.flatMap(([name, label]) => (Object.hasOwn(placed, name) ? [{ name, label, position: placed[name] }] : []));
  }

  /** For the preview: planes by number, none for a segment that the build cuts by itself. */
  get cuts(): PieceCut[] {
    return this.recipe.segments.map(({ osteotomy = "bssro", planes = [] }) => ({ osteotomy, planes: planes.filter(hasPoint) }));
  }

  private keep(recipe: Recipe): void {
    const before = this.history.now.ct;
    this.history.add(recipe);
    this.store();
    if (JSON.stringify(before) !== JSON.stringify(recipe.ct)) this.showVolume();
  }

  private store(): void {
    this.storage?.setItem(STORAGE_KEY, recipeText(this.history.now));
  }

  private stored(): Recipe {
    const text = this.storage?.getItem(STORAGE_KEY) ?? null;
    try {
      return text === null ? EMPTY_RECIPE : parseDraft(text);
    } catch {
      // Of another version of the page.
      return EMPTY_RECIPE;
    }
  }

  private notify(): void {
    this.selectedSegment = Math.max(0, Math.min(this.selectedSegment, this.recipe.segments.length - 1));
    if (this.selectedPlane !== null && !this.planes.some(({ id }) => id === this.selectedPlane)) this.selectedPlane = null;
    this.listeners.forEach((listener) => listener(this));
  }
}

function middleOf({ size, spacing, origin, directions }: Volume["grid"]): Vector {
  const half = size.map((count, axis) => ((count - 1) / 2) * spacing[axis]);
  return directions.reduce<Vector>((sum, direction, axis) => {
    const [x, y, z] = scaled(direction, half[axis]);
    return [sum[0] + x, sum[1] + y, sum[2] + z];
  }, origin);
}
