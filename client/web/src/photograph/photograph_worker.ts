// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type DroppedFile, type ReadPhotograph, readPhotograph } from "./read_photograph";
import { type Registration, type RegistrationTask, register } from "./registration";

// The classic worker: all of it is bundled into one file, nothing is fetched at run time.

export type PhotographQuestion = { kind: "read"; files: DroppedFile[] } | { kind: "register"; task: RegistrationTask };
export type PhotographAnswer = { kind: "read"; read: ReadPhotograph } | { kind: "registered"; registration: Registration } | { kind: "failed"; message: string };

const scope = globalThis as unknown as {
  onmessage: ((event: MessageEvent<PhotographQuestion>) => void) | null;
  postMessage(message: PhotographAnswer): void;
};

async function answer(question: PhotographQuestion): Promise<PhotographAnswer> {
  try {
    if (question.kind === "read") return { kind: "read", read: await readPhotograph(question.files) };
    return { kind: "registered", registration: register(question.task) };
  } catch (thrown) {
    return { kind: "failed", message: thrown instanceof Error ? thrown.message : "the photograph cannot be used" };
  }
}

scope.onmessage = ({ data }) => void answer(data).then((message) => scope.postMessage(message));
