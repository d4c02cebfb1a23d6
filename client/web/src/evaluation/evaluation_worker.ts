// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { EvaluationService, type FromWorker, type ToWorker } from "./evaluation_service";

// The classic worker: all of it is bundled into one file, nothing is fetched at run time.

const scope = globalThis as unknown as {
  onmessage: ((event: MessageEvent<ToWorker>) => void) | null;
  postMessage(message: FromWorker, transfer: Transferable[]): void;
};
const service = new EvaluationService((message, transfer) => scope.postMessage(message, transfer));
scope.onmessage = ({ data }) => void service.take(data);
