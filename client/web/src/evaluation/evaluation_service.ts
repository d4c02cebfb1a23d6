// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Pose } from "../geometry/pose";
import { AnswerEvaluator, type ValueKind } from "./answer_evaluator";

// What page and worker say to each other. A worker is loaded once, and answers one question at a time, in their order.

export type ToWorker = { kind: "load"; bytes: Uint8Array; sha256: string; module: WebAssembly.Module } | { kind: "evaluate"; poses: Pose[] } | { kind: "values"; of: ValueKind; poses: Pose[] } | { kind: "places"; poseSets: Pose[][]; vertices: Int32Array };

export type FromWorker =
  | { kind: "ready"; medianMs: number }
  | { kind: "failed"; message: string }
  | { kind: "values"; values: Float32Array | null }
  | { kind: "evaluated"; positions: Float32Array; coverage: "covered" | "beyond"; errorBoundMm: number; isEstimate: boolean; uncertainty: Float32Array | null };

/** The worker's side, for any context that has a `post`. */
export class EvaluationService {
  private evaluator: AnswerEvaluator | null = null;

  constructor(private readonly post: (message: FromWorker, transfer: Transferable[]) => void) {}

  async take(message: ToWorker): Promise<void> {
    try {
      if (message.kind === "load") await this.load(message);
      else if (message.kind === "values") this.post({ kind: "values", values: this.evaluator?.valuesAt(message.poses, message.of) ?? null }, []);
      else if (message.kind === "places") this.post({ kind: "values", values: this.evaluator?.placesAt(message.poseSets, message.vertices) ?? null }, []);
      else this.evaluate(message.poses);
    } catch (thrown) {
      this.post({ kind: "failed", message: thrown instanceof Error ? thrown.message : String(thrown) }, []);
    }
  }

  private async load({ bytes, sha256, module }: ToWorker & { kind: "load" }): Promise<void> {
    this.evaluator = await AnswerEvaluator.open(bytes, module, sha256);
    this.post({ kind: "ready", medianMs: this.evaluator.measure(() => performance.now()) }, []);
  }

  private evaluate(poses: Pose[]): void {
    if (this.evaluator === null) return;
    const { positions, uncertainty, ...rest } = this.evaluator.evaluate(poses);
    // The evaluator's own arrays stay here.
    const sent = positions.slice();
    const band = uncertainty?.slice() ?? null;
    this.post({ kind: "evaluated", positions: sent, uncertainty: band, ...rest }, band === null ? [sent.buffer] : [sent.buffer, band.buffer]);
  }
}
