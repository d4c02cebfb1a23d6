// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Pose } from "../geometry/pose";
import type { Answer } from "./answer_engine";
import type { Engine } from "./engine";

export interface AnswerListener {
  /** `answer`: null where the answers do not reach. */
  onAnswer(poses: Pose[], answer: Answer | null): void;
  /** The poses have no answer, nor may those after them. */
  onFailed(thrown: unknown): void;
}

/** Asks an engine for the newest poses, one question at a time. */
export class NewestPoses {
  private waiting: Pose[] | null = null;
  private isAsking = false;

  constructor(
    private readonly engine: Pick<Engine, "ask">,
    private readonly listener: AnswerListener,
  ) {}

  /** What was asked last is answered. */
  get isIdle(): boolean {
    return !this.isAsking && this.waiting === null;
  }

  /** Replaces those that wait. Nothing is thrown. */
  async ask(poses: Pose[]): Promise<void> {
    this.waiting = poses;
    if (this.isAsking) return;
    this.isAsking = true;
    while (this.waiting !== null) {
      const asked: Pose[] = this.waiting;
      this.waiting = null;
      try {
        this.listener.onAnswer(asked, await this.engine.ask(asked));
      } catch (thrown) {
        this.listener.onFailed(thrown);
      }
    }
    this.isAsking = false;
  }
}
