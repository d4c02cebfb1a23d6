// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { create } from "@bufbuild/protobuf";
import { expect, test } from "vitest";
import { MeasureSchema } from "../../src/generated/tissueform/v1/export_service_pb";
import { type Prediction, PredictionSchema } from "../../src/generated/tissueform/v1/prediction_pb";
import { DeformationModel } from "../../src/generated/tissueform/v1/session_pb";
import { StoredPredictions } from "../../src/workbench/stored_predictions";

const OLD = create(PredictionSchema, { name: "predictions/old" });

/** What was done, in words, and a server that may refuse. */
function stored(refuse = false) {
  const done: string[] = [];
  const answer = async <T>(word: string, value: T): Promise<T> => {
    if (refuse) throw new Error("refused");
    done.push(word);
    return value;
  };
  const answers = {
    list: () => answer("list", [OLD]),
    store: (session: string, model: DeformationModel, _: unknown, title: string) => answer(`store ${session} ${model} ${title}`, create(PredictionSchema, { name: "predictions/new" })),
    remove: ({ name }: Prediction) => answer(`remove ${name}`, undefined),
  };
  const pacs = { send: ({ name }: Prediction, measures: unknown[]) => answer(`send ${name} with ${measures.length}`, undefined) };
  const predictions = new StoredPredictions(answers, pacs, {
    question: () => ({ session: "sessions/s", model: DeformationModel.NEO_HOOKEAN, poses: [] }),
    measuresOf: async () => [create(MeasureSchema)],
    onRemoved: async ({ name }) => void done.push(`forget ${name}`),
  });
  return { predictions, done, names: () => predictions.all.value.map(({ name }) => name) };
}

test("the newest stands first, and what is removed is shown nowhere", async () => {
  const { predictions, done, names } = stored();
  await predictions.load();
  await predictions.store("chin up");
  expect(names()).toEqual(["predictions/new", "predictions/old"]);
  await predictions.send(OLD);
  await predictions.remove(OLD);
  expect(names()).toEqual(["predictions/new"]);
  expect(done).toEqual(["list", `store sessions/s ${DeformationModel.NEO_HOOKEAN} chin up`, "send predictions/old with 1", "remove predictions/old", "forget predictions/old"]);
});

test("what the server refuses changes nothing", async () => {
  const { predictions, done, names } = stored(true);
  predictions.all.value = [OLD];
  for (const refused of [predictions.store("chin up"), predictions.remove(OLD), predictions.send(OLD), predictions.load()]) await expect(refused).rejects.toThrow("refused");
  expect(names()).toEqual(["predictions/old"]);
  expect(done).toEqual([]);
});
