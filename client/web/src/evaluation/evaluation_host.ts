// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Pose } from "../geometry/pose";
import { AnswerEvaluator, type Evaluation, EvaluationError, type ValueKind } from "./answer_evaluator";
import type { FromWorker, ToWorker } from "./evaluation_service";
import { evaluatorModule } from "./evaluator_module";

/**
 * An evaluation in the page itself is shown in the same picture as the pose; from a worker it comes a picture later. So long, in
 * ms, the page does it: half a picture.
 */
const PAGE_BUDGET_MS = 8;

export interface HostListener {
  /** `number`: that of the question. */
  onEvaluation(evaluation: Evaluation, number: number): void;
  /** The worker has ended by itself, or cannot answer: nothing more comes of this host. */
  onEnded(): void;
}

/** Where answers are evaluated. A question replaces one that waits. */
export interface EvaluationHost {
  readonly place: "page" | "worker";
  /** False: the browser runs none, and the page does what is slow, too. */
  readonly hasWorkers: boolean;
  /** In the page it is answered before this returns. */
  ask(poses: readonly Pose[], number: number): void;
  /** As of AnswerEvaluator; null, too, where the host was closed. Listeners for answers receive nothing. */
  valuesAt(poses: readonly Pose[], kind: ValueKind): Promise<Float32Array | null>;
  placesAt(poseSets: readonly (readonly Pose[])[], vertices: Int32Array): Promise<Float32Array | null>;
  close(): void;
}

/** What of a worker is used; tests have their own. */
export type WorkerLike = Pick<Worker, "onmessage" | "onerror" | "terminate"> & { postMessage(message: ToWorker): void };

/** Null where the browser makes none. */
export function evaluationWorker(): WorkerLike | null {
  try {
    return new Worker(new URL("./evaluation_worker.ts", import.meta.url));
  } catch {
    return null;
  }
}

/** Checks the bytes beside the page where it can. Rejects with an EvaluationError for bytes that are not good, and without WebAssembly. */
export async function makeHost(bytes: Uint8Array, sha256: string, listener: HostListener, makeWorker: () => WorkerLike | null = evaluationWorker): Promise<EvaluationHost> {
  const module = await evaluatorModule();
  const worker = makeWorker();
  const ready = worker === null ? null : await load(worker, { kind: "load", bytes, sha256, module });
  if (worker === null || ready === null) return new PageHost(await AnswerEvaluator.open(bytes, module, sha256), listener, false);
  if (ready.medianMs > PAGE_BUDGET_MS) return new WorkerHost(worker, listener);
  worker.terminate();
  return new PageHost(await AnswerEvaluator.open(bytes, module), listener, true);
}

/** Null where the worker does not run at all. */
function load(worker: WorkerLike, message: ToWorker): Promise<{ medianMs: number } | null> {
  return new Promise((resolve, reject) => {
    worker.onerror = () => {
      worker.terminate();
      resolve(null);
    };
    worker.onmessage = ({ data }: MessageEvent<FromWorker>) => {
      if (data.kind === "ready") resolve(data);
      if (data.kind !== "failed") return;
      worker.terminate();
      reject(new EvaluationError(data.message));
    };
    worker.postMessage(message);
  });
}

class PageHost implements EvaluationHost {
  readonly place = "page";

  constructor(
    private readonly evaluator: AnswerEvaluator,
    private readonly listener: HostListener,
    readonly hasWorkers: boolean,
  ) {}

  ask(poses: readonly Pose[], number: number): void {
    this.listener.onEvaluation(this.evaluator.evaluate(poses), number);
  }

  async valuesAt(poses: readonly Pose[], kind: ValueKind): Promise<Float32Array | null> {
    return this.evaluator.valuesAt(poses, kind);
  }

  async placesAt(poseSets: readonly (readonly Pose[])[], vertices: Int32Array): Promise<Float32Array | null> {
    return this.evaluator.placesAt(poseSets, vertices);
  }

  close(): void {}
}

class WorkerHost implements EvaluationHost {
  readonly place = "worker";
  readonly hasWorkers = true;
  /** Of the question that the worker has; null: none. */
  private asked: number | null = null;
  private waiting: { poses: readonly Pose[]; number: number } | null = null;
  /** Those that wait for values, the first first. */
  private readonly asking: ((values: Float32Array | null) => void)[] = [];
  private isClosed = false;

  constructor(
    private readonly worker: WorkerLike,
    private readonly listener: HostListener,
  ) {
    worker.onmessage = ({ data }: MessageEvent<FromWorker>) => this.take(data);
    worker.onerror = () => this.end();
  }

  ask(poses: readonly Pose[], number: number): void {
    this.waiting = { poses, number };
    this.send();
  }

  valuesAt(poses: readonly Pose[], kind: ValueKind): Promise<Float32Array | null> {
    return this.askValues({ kind: "values", of: kind, poses: [...poses] });
  }

  placesAt(poseSets: readonly (readonly Pose[])[], vertices: Int32Array): Promise<Float32Array | null> {
    return this.askValues({ kind: "places", poseSets: poseSets.map((poses) => [...poses]), vertices });
  }

  close(): void {
    this.isClosed = true;
    this.worker.onmessage = null;
    this.worker.onerror = null;
    this.worker.terminate();
    this.asking.splice(0).forEach((done) => done(null));
  }

  private askValues(message: ToWorker): Promise<Float32Array | null> {
    return new Promise((done) => {
      if (this.isClosed) return done(null);
      this.asking.push(done);
      this.worker.postMessage(message);
    });
  }

  private end(): void {
    this.close();
    this.listener.onEnded();
  }

  private send(): void {
    if (this.isClosed || this.asked !== null || this.waiting === null) return;
    this.asked = this.waiting.number;
    this.worker.postMessage({ kind: "evaluate", poses: [...this.waiting.poses] });
    this.waiting = null;
  }

  private take(message: FromWorker): void {
    if (message.kind === "failed") return this.end();
    if (message.kind === "values") this.asking.shift()?.(message.values);
    if (message.kind !== "evaluated" || this.asked === null) return;
    const number = this.asked;
    this.asked = null;
    this.send();
    this.listener.onEvaluation(message, number);
  }
}
