// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Measure } from "../generated/tissueform/v1/export_service_pb";
import type { Prediction } from "../generated/tissueform/v1/prediction_pb";
import type { DeformationModel } from "../generated/tissueform/v1/session_pb";
import type { Pose } from "../geometry/pose";
import type { Answers } from "./answers";
import type { PacsExports } from "./pacs_exports";
import { Signal } from "./signal";

/** What is predicted when the user stores the prediction. */
export interface Question {
  session: string;
  model: DeformationModel;
  poses: Pose[];
}

/** What the workbench does for them. */
export interface PredictionUses {
  question(): Question;
  /** The numbers of a stored prediction's face. */
  measuresOf(prediction: Prediction): Promise<Measure[]>;
  /** It is there no more: nothing may show it. */
  onRemoved(prediction: Prediction): Promise<void>;
}

/** The predictions that the server keeps of a case, newest first, and what is done with them. Every call rejects with a CallError. */
export class StoredPredictions {
  readonly all = new Signal<readonly Prediction[]>([]);

  constructor(
    private readonly answers: Pick<Answers, "list" | "remove" | "store">,
    private readonly pacs: Pick<PacsExports, "send">,
    private readonly uses: PredictionUses,
  ) {}

  async load(): Promise<void> {
    this.all.value = await this.answers.list();
  }

  /** Solves in full and keeps it. `poses`: left out, those of the plan. */
  async store(title: string, poses?: Pose[]): Promise<Prediction> {
    const { session, model, poses: planned } = this.uses.question();
    const prediction = await this.answers.store(session, model, poses ?? planned, title);
    this.all.value = [prediction, ...this.all.value];
    return prediction;
  }

  async remove(prediction: Prediction): Promise<void> {
    await this.answers.remove(prediction);
    this.all.value = this.all.value.filter((other) => other.name !== prediction.name);
    await this.uses.onRemoved(prediction);
  }

  /** Asks for it to be stored in the patient's study, with the numbers of its face. */
  async send(prediction: Prediction): Promise<void> {
    await this.pacs.send(prediction, await this.uses.measuresOf(prediction));
  }
}
