// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { Code, messageOf, toCallError } from "../calls/call_error";
import type { Gateway } from "../calls/gateway";
import type { Evaluation } from "../evaluation/answer_evaluator";
import { type EvaluationHost, makeHost } from "../evaluation/evaluation_host";
import type { DeformConfiguration } from "../generated/tissueform/v1/deform_service_pb";
import type { Pose } from "../geometry/pose";
import { type FetchedColumns, fetchColumns } from "./column_fetch";

/** Who answers the hand: the page itself, or the server, and why. */
export type LocalState =
  | { kind: "none" }
  | { kind: "fetching"; share: number }
  | { kind: "ready"; place: "page" | "worker"; hasWorkers: boolean; coverage: Evaluation["coverage"] }
  | { kind: "stopped" }
  | { kind: "failed"; text: string };

export interface LocalListener {
  onState(state: LocalState): void;
  /** Covered, and of the newest poses or of ones that are newer than any shown before. */
  onEvaluation(evaluation: Evaluation): void;
}

/**
 * Answers of the page's own: columns are fetched while the server answers, then every pose is evaluated here. The server's frames
 * confirm or correct them, and answer what is beyond the prepared range. Nothing is thrown.
 */
export class LocalAnswers {
  private host: EvaluationHost | null = null;
  private configuration: DeformConfiguration | null = null;
  private columns: FetchedColumns | null = null;
  private running: AbortController | null = null;
  private isStopped = false;
  private poses: readonly Pose[] | null = null;
  private asked = 0;
  /** Of the newest question whose answer was covered and shown. */
  private shown = -Infinity;

  constructor(
    private readonly gateway: Pick<Gateway, "deform">,
    private readonly listener: LocalListener,
    private readonly makeEvaluationHost: typeof makeHost = makeHost,
  ) {}

  /** The drag goes on with this configuration: what the page has stays good if the server's columns are still the same. */
  async follow(configuration: DeformConfiguration): Promise<void> {
    const isSame = this.configuration !== null && keyOf(configuration) === keyOf(this.configuration);
    if (!isSame) this.drop();
    this.configuration = configuration;
    if (configuration.prepared === undefined || this.isStopped) return;
    this.running?.abort();
    const run = (this.running = new AbortController());
    try {
      await this.fetch(configuration, run.signal);
    } catch (thrown) {
      if (run.signal.aborted) return;
      const error = toCallError(thrown);
      if (error.code === Code.Canceled) return;
      // What it has stays good while the server is away: the next start of the drag asks again.
      if (error.isPassing && this.host !== null) return this.report("covered");
      this.drop();
      this.listener.onState({ kind: "failed", text: messageOf(thrown) });
    }
  }

  /** The session is another one than that of the columns: until they are fetched again the server answers. */
  drop(): void {
    this.running?.abort();
    this.running = null;
    this.host?.close();
    this.host = null;
    this.columns = null;
    this.shown = -Infinity;
    if (!this.isStopped) this.listener.onState({ kind: "none" });
  }

  /** The session was updated. */
  renew(): void {
    this.drop();
    if (this.configuration !== null) void this.follow(this.configuration);
  }

  /** The server answers from now on. */
  stop(): void {
    this.isStopped = true;
    this.drop();
    this.listener.onState({ kind: "stopped" });
  }

  resume(): void {
    this.isStopped = false;
    if (this.configuration !== null) void this.follow(this.configuration);
  }

  /** New poses of the hand. If the page evaluates them itself, it reports the answer before this returns. */
  ask(poses: readonly Pose[]): void {
    this.poses = poses;
    this.asked += 1;
    this.host?.ask(poses, this.asked);
  }

  /** Where every vertex is under other poses, mm; null where the page has no columns, or they do not cover the poses. */
  positionsAt(poses: readonly Pose[]): Promise<Float32Array | null> {
    return this.host?.valuesAt(poses, "positions") ?? Promise.resolve(null);
  }

  /** Of each set of poses where these vertices are, mm; null likewise. */
  placesAt(poseSets: readonly (readonly Pose[])[], vertices: Int32Array): Promise<Float32Array | null> {
    return this.host?.placesAt(poseSets, vertices) ?? Promise.resolve(null);
  }

  /** Within the picture of the pose; otherwise some pictures later, or not at all. */
  get answersAtOnce(): boolean {
    return this.host?.place === "page";
  }

  /** The band of other poses than those of the hand, of every vertex, mm; null where the columns know none. */
  bandAt(poses: readonly Pose[]): Promise<Float32Array | null> {
    return this.host?.valuesAt(poses, "band") ?? Promise.resolve(null);
  }

  /** Of other poses, too: the force in N of every contact row that may lift off; null where the page has no columns that know. */
  contactAt(poses: readonly Pose[]): Promise<Float32Array | null> {
    return this.host?.valuesAt(poses, "contact") ?? Promise.resolve(null);
  }

  /** Of sealed lips; null where lips are free or the page has no columns that know. */
  async sealAt(poses: readonly Pose[]): Promise<{ partedMm: number; released: boolean } | null> {
    const values = await (this.host?.valuesAt(poses, "seal") ?? null);
    return values && { partedMm: values[0], released: values[1] !== 0 };
  }

  /** The columns that the page answers by, as they travel; null where it has none. */
  get heldColumns(): Uint8Array<ArrayBuffer> | null {
    return this.columns === null ? null : this.columns.bytes.slice();
  }

  /** How many poses have been asked for since the one whose answer the page has shown; infinite where it has shown none. */
  get posesSinceShown(): number {
    return this.asked - this.shown;
  }

  private async fetch(configuration: DeformConfiguration, signal: AbortSignal): Promise<void> {
    const onProgress = (share: number) => {
      if (!signal.aborted) this.listener.onState({ kind: "fetching", share });
    };
    const columns = await fetchColumns(this.gateway, configuration, { known: this.columns?.sha256 ?? "", onProgress, signal });
    if (signal.aborted || columns === null) return;
    const host = await this.makeEvaluationHost(columns.bytes, columns.sha256, { onEvaluation: (evaluation, number) => this.take(evaluation, number), onEnded: () => this.end() });
    if (signal.aborted) {
      host.close();
      return;
    }
    this.host?.close();
    this.host = host;
    this.columns = columns;
    this.report("covered");
    if (this.poses !== null) host.ask(this.poses, this.asked);
  }

  private end(): void {
    this.drop();
    this.listener.onState({ kind: "failed", text: "the background worker stopped." });
  }

  private take(evaluation: Evaluation, number: number): void {
    const { coverage } = evaluation;
    this.report(coverage);
    if (coverage === "beyond" || number <= this.shown) return;
    this.shown = number;
    this.listener.onEvaluation(evaluation);
  }

  private report(coverage: Evaluation["coverage"]): void {
    if (this.host === null) return;
    const { place, hasWorkers } = this.host;
    this.listener.onState({ kind: "ready", place, hasWorkers, coverage });
  }
}

/** What decides about the columns. */
function keyOf({ session, model, prepared }: DeformConfiguration): string {
  return [session, model ?? "", prepared === undefined ? "" : `${prepared.toleranceMm} ${prepared.maxRotation} ${prepared.ranges !== undefined}`].join(" ");
}
