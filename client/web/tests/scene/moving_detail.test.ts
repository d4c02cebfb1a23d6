// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { BufferGeometry } from "three";
import { afterEach, beforeEach, describe, expect, test, vi } from "vitest";
import { MovingDetail } from "../../src/scene/moving_detail";

const FULL = Uint32Array.from([0, 1, 2, 1, 2, 3, 2, 3, 4]);
const COARSE = Uint32Array.from([0, 2, 4]);

/** On a stage that takes `ms` for a picture of all triangles. */
function made(ms: number) {
  const geometry = new BufferGeometry();
  let drawn = 0;
  const stage = { invalidate: () => {}, drawNow: () => (++drawn, ms) };
  const detail = new MovingDetail(stage, geometry, FULL, COARSE);
  const shown = () => {
    const { start, count } = geometry.drawRange;
    return [...(geometry.index?.array ?? []).slice(start, start + count)];
  };
  return { detail, shown, drawn: () => drawn };
}

const rest = () => vi.advanceTimersByTime(1000);

describe("the detail of what moves", () => {
  beforeEach(() => void vi.useFakeTimers());
  afterEach(() => void vi.useRealTimers());

  test("is full before anything moves, fewer triangles while it does, and full at rest", () => {
    const { detail, shown } = made(700);
    expect(shown()).toEqual([...FULL]);
    detail.move();
    expect(shown()).toEqual([...COARSE]);
    rest();
    expect(shown()).toEqual([...FULL]);
    detail.move();
    expect(shown()).toEqual([...COARSE]);
  });

  test("stays coarse while a hand holds still, until it lets go", () => {
    const { detail, shown } = made(700);
    detail.isHeld = true;
    detail.move();
    rest();
    expect(shown()).toEqual([...COARSE]);
    detail.isHeld = false;
    detail.move();
    rest();
    expect(shown()).toEqual([...FULL]);
  });

  test("stays full where a full picture is drawn fast", () => {
    const { detail, shown } = made(8);
    detail.move();
    rest();
    detail.move();
    expect(shown()).toEqual([...FULL]);
  });

  test("draws nothing after it was disposed of", () => {
    const { detail, drawn } = made(700);
    detail.move();
    detail.dispose();
    rest();
    expect(drawn()).toBe(0);
  });
});
