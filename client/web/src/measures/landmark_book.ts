// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { CaseFile } from "../case/case_file";
import type { Vector } from "../geometry/rotation";
import { History } from "../planning/history";
import { type Anchor, anchorPoint, nearestAnchor, readAnchor } from "./anchor";
import { FACE_LANDMARKS, type FaceLandmark, sideProblem } from "./face_landmarks";
import { faceFrame, hasHeadFrame, toFacePoint } from "./face_point";
import { type OwnMeasure, readOwnMeasures } from "./own_measures";

/** Placed by hand or confirmed ones count; a suggestion does not until it is confirmed. */
export type Anchors = ReadonlyMap<string, Anchor>;

interface State {
  placed: Anchors;
  own: readonly OwnMeasure[];
}

/** What the browser and an exported plan keep. */
export interface SavedLandmarks {
  placed: [string, Anchor][];
  own: OwnMeasure[];
}

/** A point further off every surface is not on one. */
export const MOST_OFF_SURFACE_MM = 2;
export const MOST_OWN_POINTS = 24;

/** The landmarks of one case, held on its surfaces, and distances and angles of one's own between them; with undo. */
export class LandmarkBook {
  private found: Anchors = new Map();
  private history = new History<State>({ placed: new Map(), own: [] });
  private readonly listeners: (() => void)[] = [];

  constructor(private readonly file: CaseFile) {}

  get placed(): Anchors {
    return this.history.now.placed;
  }

  get own(): readonly OwnMeasure[] {
    return this.history.now.own;
  }

  get canUndo(): boolean {
    return this.history.canUndo;
  }

  get canRedo(): boolean {
    return this.history.canRedo;
  }

  /** Those that are not placed yet. */
  get suggestions(): Anchors {
    return new Map(Array.from(this.found).filter(([name]) => !this.placed.has(name)));
  }

  suggest(found: Anchors): void {
    this.found = found;
    this.notify();
  }

  onChange(listener: () => void): void {
    this.listeners.push(listener);
  }

  /** Those of the list and one's own points. */
  get landmarks(): FaceLandmark[] {
    const points = Array.from(this.placed.keys()).filter((name) => name.startsWith("point_"));
    return [...FACE_LANDMARKS, ...points.map(ownPoint)];
  }

  /** Puts a landmark onto a surface. Why it cannot be there, in a sentence; "" when it is. */
  place(name: string, anchor: Anchor | null): string {
    const landmark = name.startsWith("point_") ? ownPoint(name) : FACE_LANDMARKS.find((known) => known.name === name);
    if (landmark === undefined) return "There is no such landmark.";
    const problem = this.problem(landmark, anchor);
    if (problem !== "" || anchor === null) return problem;
    this.set({ ...this.history.now, placed: new Map([...this.placed, [name, anchor]]) });
    return "";
  }

  /** A name for the next point of one's own; "" where there are too many. */
  nextPoint(): string {
    for (let number = 1; number <= MOST_OWN_POINTS; ++number) if (!this.placed.has(`point_${number}`)) return `point_${number}`;
    return "";
  }

  /** Suggestions of these names are taken, as one step. */
  confirm(names: readonly string[]): void {
    const taken = Array.from(this.suggestions).filter(([name]) => names.includes(name));
    if (taken.length > 0) this.set({ ...this.history.now, placed: new Map([...this.placed, ...taken]) });
  }

  remove(name: string): void {
    const placed = new Map(this.placed);
    placed.delete(name);
    this.set({ placed, own: this.own.filter(({ landmarks }) => !landmarks.includes(name)) });
  }

  setOwn(own: readonly OwnMeasure[]): void {
    this.set({ ...this.history.now, own });
  }

  undo(): void {
    this.history.undo();
    this.notify();
  }

  redo(): void {
    this.history.redo();
    this.notify();
  }

  save(): SavedLandmarks {
    return { placed: Array.from(this.placed), own: [...this.own] };
  }

  /** What was saved before; what does not belong to this case is left out. */
  restore(saved: unknown): void {
    const { placed, own } = (saved ?? {}) as Partial<SavedLandmarks>;
    if (!Array.isArray(placed)) return;
    const anchors = placed.slice(0, FACE_LANDMARKS.length + MOST_OWN_POINTS).flatMap((entry): [string, Anchor][] => {
      const anchor = Array.isArray(entry) ? readAnchor(entry[1], this.file.surfaces) : null;
      const landmark = anchor === null ? undefined : landmarkOf(entry[0]);
      return anchor === null || landmark === undefined || this.problem(landmark, anchor) !== "" ? [] : [[landmark.name, anchor]];
    });
    this.history = new History<State>({ placed: new Map(anchors), own: readOwnMeasures(own) });
    this.notify();
  }

  /** The nearest point of a surface that the landmark may lie on; null where none is within 2 mm. */
  nearest(landmark: FaceLandmark, point: Vector): Anchor | null {
    let least = MOST_OFF_SURFACE_MM;
    let found: Anchor | null = null;
    this.file.surfaces.forEach((surface, index) => {
      if (!landmark.kinds.includes(surface.entry.kind) || !this.isOfJaw(landmark.name, index)) return;
      const near = nearestAnchor(surface, index, point, least);
      if (near !== null) [found, least] = [near.anchor, near.distanceMm];
    });
    return found;
  }

  private problem(landmark: FaceLandmark, anchor: Anchor | null): string {
    if (anchor === null) return `${landmark.label}: there is no ${kindText(landmark)} there; choose a point on it.`;
    const surface = this.file.surfaces[anchor.surface];
    if (!landmark.kinds.includes(surface.entry.kind)) return `${landmark.label}: this is ${surface.entry.name}; choose a point on ${kindText(landmark)}.`;
    if (!this.isOfJaw(landmark.name, anchor.surface)) return `${landmark.label}: this is ${surface.entry.name}, which moves with another segment; choose a point on its own.`;
    return sideProblem(landmark, toFacePoint(anchorPoint(surface, anchor), faceFrame(this.file)), hasHeadFrame(this.file));
  }

  /** Where the case says which segment the landmark is on, no other one holds it; and a tooth is never on the segment of those that it meets. */
  private isOfJaw(name: string, surface: number): boolean {
    const { handle } = this.file.surfaces[surface].entry;
    const own = this.handleOf(name);
    if (own !== "") return handle === own;
    return handle === "" || handle !== this.handleOf(name.replace(/^(upp|low)er/, (jaw) => (jaw === "upper" ? "lower" : "upper")));
  }

  private handleOf(name: string): string {
    return this.file.manifest.landmarks.find((known) => known.name === name.replace(/midline$/, "incisor"))?.handle ?? "";
  }

  private set(state: State): void {
    this.history.add(state);
    this.notify();
  }

  private notify(): void {
    this.listeners.forEach((listener) => listener());
  }
}

function landmarkOf(name: unknown): FaceLandmark | undefined {
  if (typeof name !== "string") return undefined;
  return /^point_([1-9]|1\d|2[0-4])$/.test(name) ? ownPoint(name) : FACE_LANDMARKS.find((known) => known.name === name);
}

function ownPoint(name: string): FaceLandmark {
  const number = name.replace("point_", "");
  return { name, label: `Point ${number}`, short: `P${number}`, kinds: ["skin", "bone", "segment", "teeth"], side: "any", hint: "a point of your own" };
}

function kindText({ kinds }: FaceLandmark): string {
  if (kinds.includes("skin")) return "skin";
  return kinds.includes("teeth") ? "teeth" : "bone";
}
