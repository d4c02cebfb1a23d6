// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { LabelMap, Volume } from "../volume/volume";
import { PREVIEW_MM, placesOf, reduceVolume, resampleLabels } from "./bone_grid";
import type { BoneSurface, CutAnswer, CutBone, FromBoneWorker, ToBoneWorker } from "./bone_worker";
import { Jaw } from "./pieces";
import { type Structure, structuresOf } from "./structures";
import type { Recipe } from "./recipe";

/** Structures that cuts are to keep away from. */
const GUARDED: readonly Structure[] = ["upper_teeth", "lower_teeth", "canal"];
const MOST_PLACES = 60_000;

export interface BonePreviewListener {
  onSurface(surface: BoneSurface): void;
  /** `ms`: from the question to this answer. */
  onPieces(answer: CutAnswer, ms: number): void;
  /** One sentence: there is no preview. */
  onProblem(text: string): void;
}

/** The worker that holds the bone of one volume. A question replaces one that waits. */
export class BonePreview {
  private readonly worker = new Worker(new URL("./bone_worker.ts", import.meta.url), { type: "module" });
  private readonly ending = new AbortController();
  private waiting: Omit<CutBone, "kind" | "number"> | null = null;
  private isBusy = true;
  private number = 0;
  private askedAt = 0;

  constructor(private readonly listener: BonePreviewListener) {
    this.worker.onmessage = ({ data }: MessageEvent<FromBoneWorker>) => this.take(data);
    this.worker.onerror = () => this.listener.onProblem("The preview of the bone has stopped: reload the page; the recipe stays.");
  }

  /** `threshold`: in the volume's own values. Rejects when it is ended first. */
  async load(volume: Volume, threshold: number, labels: LabelMap | null, recipe: Recipe): Promise<void> {
    const { grid, values } = await reduceVolume(volume, PREVIEW_MM, this.ending.signal);
    const structures = labels === null ? new Map<number, Structure>() : structuresOf(labels, recipe);
    const jaws = labels === null ? null : resampleLabels(labels, jawCodes(structures), grid);
    const guarded = new Map(GUARDED.map((structure) => [structure as string, labels === null ? new Float32Array() : placesOf(labels, numbersOf(structures, structure), MOST_PLACES)] as const));
    const labelMm = labels === null ? 0 : Math.max(...labels.grid.spacing);
    this.post({ kind: "load", grid, values, threshold, jaws, structures: guarded, labelMm }, [values.buffer as ArrayBuffer]);
  }

  cut(question: Omit<CutBone, "kind" | "number">): void {
    this.waiting = question;
    this.askNext();
  }

  dispose(): void {
    this.ending.abort(new Error("the preview has ended"));
    this.worker.terminate();
  }

  private askNext(): void {
    if (this.isBusy || this.waiting === null) return;
    this.isBusy = true;
    this.askedAt = performance.now();
    this.post({ kind: "cut", number: ++this.number, ...this.waiting });
    this.waiting = null;
  }

  private take(message: FromBoneWorker): void {
    this.isBusy = false;
    if (message.kind === "surface") this.listener.onSurface(message);
    else this.listener.onPieces(message, performance.now() - this.askedAt);
    this.askNext();
  }

  private post(message: ToBoneWorker, transfer: Transferable[] = []): void {
    this.worker.postMessage(message, transfer);
  }
}

function jawCodes(structures: ReadonlyMap<number, Structure>): Map<number, number> {
  const lower: readonly Structure[] = ["mandible", "lower_teeth", "canal"];
  return new Map([...structures].map(([number, structure]) => [number, lower.includes(structure) ? Jaw.lower : Jaw.upper]));
}

function numbersOf(structures: ReadonlyMap<number, Structure>, wanted: Structure): Set<number> {
  return new Set([...structures].filter(([, structure]) => structure === wanted).map(([number]) => number));
}
