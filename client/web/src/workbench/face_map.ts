// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { DeformationModel } from "../generated/tissueform/v1/session_pb";
import type { Prediction } from "../generated/tissueform/v1/prediction_pb";
import type { Head } from "../scene/head";
import { FaceColors, type MapLegend, subtractInto } from "./face_colors";
import { Signal } from "./signal";

/** What the colors of the skin show. */
export type MapChoice =
  | { kind: "none" }
  | { kind: "movement" }
  | { kind: "band" }
  | { kind: "model"; model: DeformationModel; label: string }
  | { kind: "prediction"; prediction: Prediction };

/** Where a map has what the face is compared with; both reject where it cannot be had. Displacements of CaseFile.followed. */
export interface MapSources {
  ofModel(model: DeformationModel): Promise<Float32Array>;
  ofPrediction(prediction: Prediction): Promise<Float32Array>;
}

/** The colors of the skin: which map, what it compares the face with, and its legend. */
export class FaceMap {
  readonly choice = new Signal<MapChoice>({ kind: "none" });
  readonly legend = new Signal<MapLegend | null>(null);

  private readonly colors: FaceColors;
  private other: Float32Array | null = null;

  constructor(
    head: Head,
    private readonly sources: MapSources,
  ) {
    this.colors = new FaceColors(head);
  }

  /** Rejects where what is compared with could not be had; the map is off then. */
  async choose(choice: MapChoice): Promise<void> {
    this.choice.value = choice;
    this.other = null;
    try {
      await this.refresh();
    } catch (thrown) {
      this.choice.value = { kind: "none" };
      throw thrown;
    }
  }

  /** Reads again what the face is compared with: another model answers other poses differently. */
  async refresh(): Promise<void> {
    const choice = this.choice.value;
    let other: Float32Array | null = null;
    if (choice.kind === "model") other = await this.sources.ofModel(choice.model);
    if (choice.kind === "prediction") other = await this.sources.ofPrediction(choice.prediction);
    // The user may have chosen another map since then.
    if (choice === this.choice.value) this.other = other;
  }

  /** Colours a face. `displacements` and `uncertainty`: of CaseFile.followed. */
  show(displacements: Float32Array, uncertainty: Float32Array | null): void {
    const legend = this.color(displacements, uncertainty);
    if (legend !== null || this.legend.value !== null) this.legend.value = legend;
  }

  private color(displacements: Float32Array, uncertainty: Float32Array | null): MapLegend | null {
    const { colors, other } = this;
    const map = this.choice.value;
    if (map.kind === "movement") return colors.showLengths("Movement of the skin", displacements, uncertainty);
    if (map.kind === "band" && uncertainty !== null) return colors.showNumbers("95 % interval (stiffness only; excludes model and surgical error)", uncertainty);
    if ((map.kind === "model" || map.kind === "prediction") && other !== null) {
      const title = map.kind === "model" ? `Difference to ${map.label}` : `Difference to “${map.prediction.title}”`;
      return colors.showLengths(title, subtractInto(displacements, other, new Float32Array(displacements.length)));
    }
    colors.clear();
    return null;
  }
}
