// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { button, el } from "../panels/dom";
import { PictureBox } from "../panels/picture_box";
import { BoneView } from "../scene/bone_view";
import { cssColor, segmentColor } from "../scene/materials";
import { VIEWS, type ViewName } from "../scene/views";
import { type DraggablePlane, type DraggablePoint, SliceViews } from "../slices/slice_views";
import type { Vector } from "../geometry/rotation";
import type { Volume } from "../volume/volume";
import type { CutAnswer } from "./bone_worker";
import { BonePreview } from "./bone_preview";
import type { NamedPlane, PlanDraft } from "./plan_draft";
import { structuresOf } from "./structures";

const REFERENCE_COLOR = "#d0d4da";
const LANDMARK_COLOR = "#ffd34d";
const CROSSHAIR_COLOR = "#ff6a5c";
const DEFAULT_BONE_HU = 250;
const LABEL_COLORS = { mandible: "#6fb7e6", skull: "#e3dac6", upper_teeth: "#f0b54a", lower_teeth: "#e9dc6b", canal: "#e0705f" } as const;

export interface PlanViewsListener {
  onPieces(answer: CutAnswer, ms: number): void;
  onProblem(text: string): void;
}

/** Slices and bone of the draft's CT, with what of it can be dragged. */
export class PlanViews {
  readonly element: HTMLElement;
  private readonly slices: SliceViews;
  private readonly box = new PictureBox(() => {});
  private readonly bone: BoneView;
  private preview: BonePreview | null = null;
  private volume: Volume | null = null;
  private threshold = NaN;
  private marginMm = 0;
  private asked = "";
  private frame = "";
  /** Which planes are shown: those of a segment, or those of reference. */
  private shows: "cuts" | "references" = "references";

  constructor(
    private readonly draft: PlanDraft,
    private readonly listener: PlanViewsListener,
  ) {
    const onPlane = (id: string, point: Vector, normal: Vector, isDone: boolean) => draft.movePlane(id, { point_mm: point, normal }, isDone);
    this.slices = new SliceViews({
      onCrosshair: (point) => this.setCrosshair(point),
      onPoint: (name, position, isDone) => draft.setLandmark(name, position, isDone),
      onPlane,
    });
    this.bone = new BoneView(this.box.element, {
      ...this.box.listener,
      onPlane,
      onBone: (point) => {
        this.setCrosshair(point);
        this.slices.setCrosshair(point);
      },
    });
    this.box.dress(this.bone, "3D view of the bone. Drag turns it; a click on bone sets the crosshair.");
    this.box.element.append(this.bar());
    this.element = el("div", { class: "plan-views" }, [this.slices.element, this.box.element]);
  }

  show(shows: "cuts" | "references", marginMm: number): void {
    [this.shows, this.marginMm] = [shows, marginMm];
    this.update();
  }

  update(): void {
    this.updateVolume();
    this.updateFrame();
    this.updateMarks();
    this.askPieces();
  }

  dispose(): void {
    this.preview?.dispose();
    this.slices.dispose();
    this.bone.dispose();
  }

  private updateVolume(): void {
    const { shown, labels, recipe } = this.draft;
    const threshold = boneThreshold(recipe.segmentation?.bone_above_hu, recipe.ct?.bone_above_gray);
    if (shown === null || (shown === this.volume && threshold === this.threshold)) return;
    [this.volume, this.threshold, this.asked] = [shown, threshold, ""];
    this.slices.setVolume(shown);
    const structures = labels === null ? [] : [...structuresOf(labels, recipe)];
    this.slices.setLabels(labels, new Map(structures.map(([number, structure]) => [number, LABEL_COLORS[structure]])));
    this.slices.setCrosshair(this.draft.crosshair);
    this.preview?.dispose();
    const preview = new BonePreview({
      onSurface: ({ positions, triangles, coarse }) => this.bone.setBone(positions, triangles, coarse),
      onPieces: (answer, ms) => {
        this.bone.colorBone(answer.labels);
        this.listener.onPieces(answer, ms);
      },
      onProblem: this.listener.onProblem,
    });
    this.preview = preview;
    // A preview that another one replaced has nothing to say.
    preview.load(shown, threshold, labels, recipe).catch((thrown: Error) => this.preview === preview && this.listener.onProblem(thrown.message));
  }

  private updateFrame(): void {
    const { frame } = this.draft;
    const text = JSON.stringify([frame.left, frame.superior]);
    if (text === this.frame) return;
    this.frame = text;
    this.slices.setAxes([frame.left, frame.posterior, frame.superior]);
    this.slices.setCrosshair(this.draft.crosshair);
    this.bone.setFrame(frame);
  }

  private updateMarks(): void {
    const { planes, selectedSegment, selectedPlane, landmarks, crosshair } = this.draft;
    const wanted = planes.filter(({ segment, id }) => id === selectedPlane || (this.shows === "cuts" ? segment === selectedSegment : segment < 0));
    const named = wanted.map((plane): DraggablePlane => ({ id: plane.id, label: plane.label, color: colorOf(plane), point: plane.plane.point_mm, normal: plane.plane.normal }));
    const points = this.shows === "cuts" ? [] : landmarks.map(({ name, label, position }): DraggablePoint => ({ id: name, label, color: LANDMARK_COLOR, position }));
    this.slices.setPlanes(named);
    this.slices.setPoints(points);
    this.bone.setMarks(named, [...points, { id: "crosshair", color: CROSSHAIR_COLOR, position: crosshair }], selectedPlane, this.draft.isHeld);
  }

  private askPieces(): void {
    const question = { cuts: this.draft.cuts, occlusal: this.draft.occlusal, marginMm: this.marginMm };
    const text = JSON.stringify(question);
    if (text === this.asked || this.preview === null) return;
    this.asked = text;
    this.preview.cut(question);
  }

  private setCrosshair(point: Vector): void {
    this.draft.setCrosshair(point);
    this.updateMarks();
  }

  private bar(): HTMLElement {
    const views = (Object.keys(VIEWS) as ViewName[]).map((name) => button(VIEWS[name].label, () => this.bone.look(name)));
    const mode = button("Tilt", () => {
      const isTilt = mode.getAttribute("aria-pressed") !== "true";
      mode.setAttribute("aria-pressed", String(isTilt));
      this.bone.setGizmoMode(isTilt ? "rotate" : "translate");
    }, { attributes: { "aria-pressed": "false", title: "Drag tilts the chosen plane instead of shifting it" } });
    return el("div", { class: "bone-bar", attributes: { role: "toolbar", "aria-label": "View of the bone" } }, [...views, mode]);
  }
}

function colorOf({ segment }: NamedPlane): string {
  return segment < 0 ? REFERENCE_COLOR : cssColor(segmentColor(segment));
}

/** In the values that are shown. */
function boneThreshold(hu: number | undefined, gray: unknown): number {
  return typeof gray === "number" ? gray : (hu ?? DEFAULT_BONE_HU);
}
