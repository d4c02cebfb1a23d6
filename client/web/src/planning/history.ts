// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

/** States of something, of which one is now; those that were undone come back until another is added. Without end. */
export class History<T> {
  private readonly states: T[];
  private at = 0;

  constructor(first: T) {
    this.states = [first];
  }

  get now(): T {
    return this.states[this.at];
  }

  get canUndo(): boolean {
    return this.at > 0;
  }

  get canRedo(): boolean {
    return this.at + 1 < this.states.length;
  }

  add(state: T): void {
    this.states.splice(++this.at, Infinity, state);
  }

  /** Does nothing at the first state. */
  undo(): T {
    this.at = Math.max(0, this.at - 1);
    return this.now;
  }

  /** Does nothing at the last state. */
  redo(): T {
    this.at = Math.min(this.states.length - 1, this.at + 1);
    return this.now;
  }
}
