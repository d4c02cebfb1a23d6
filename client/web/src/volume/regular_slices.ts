// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

// Slices by their heights alone: which lie at the steps of one scan, and what fits between them (core/imaging/ct/regular_slices.cc).

/** A slice, and where it is. */
export interface Placed {
  readonly heightMm: number;
  readonly slice: number;
}

/** By height; slices at one place stay in their order. */
export type Stack = readonly Placed[];

const SAME_PLACE_MM = 0.01;
/** One chain may pass over so many slices at once. */
const MAX_PASSED_OVER = 8;
/**
 * What a change of step costs, in slices: one slice off its place makes three changes and is passed over (3 x 0.45 > 1); steps that
 * all differ cost less than the slices are worth, so that uneven slices stay together.
 */
const CHANGE_OF_STEP = 0.45;
/** A gap that is so much wider than those about it lacks slices. */
const HOLE = 1.5;

export function sorted(stack: Stack): Placed[] {
  return [...stack].sort((a, b) => a.heightMm - b.heightMm);
}

export function areAtOnePlace(lower: Placed, upper: Placed): boolean {
  return upper.heightMm - lower.heightMm < SAME_PLACE_MM;
}

function isSameStep(a: number, b: number): boolean {
  return Math.abs(a - b) <= Math.min(0.2, 0.2 * Math.max(a, b));
}

/** The score of a chain that ends with the pair (end - back, end), and the back of the pair before it; 0 where it begins. */
interface Best {
  score: number;
  before: number;
}

/** Dynamic programming over the last pair of a chain: [end][back]. */
function chainsOf(stack: Stack): Best[][] {
  const best = stack.map(() => Array.from({ length: MAX_PASSED_OVER + 1 }, (): Best => ({ score: 0, before: 0 })));
  const step = (end: number, back: number) => stack[end].heightMm - stack[end - back].heightMm;
  for (let end = 0; end < stack.length; ++end) {
    for (let back = 1; back <= Math.min(end, MAX_PASSED_OVER); ++back) {
      if (step(end, back) < SAME_PLACE_MM) continue;
      const middle = end - back;
      best[end][back] = { score: 2, before: 0 };
      for (let before = 1; before <= Math.min(middle, MAX_PASSED_OVER); ++before) {
        if (best[middle][before].score === 0) continue;
        const score = best[middle][before].score + 1 - (isSameStep(step(end, back), step(middle, before)) ? 0 : CHANGE_OF_STEP);
        if (score > best[end][back].score) best[end][back] = { score, before };
      }
    }
  }
  return best;
}

/** The longest chain of slices at regular steps, where a change of step costs about half a slice: true for the slices in it. */
export function onRegularSteps(stack: Stack): boolean[] {
  const best = chainsOf(stack);
  let [end, back] = [0, 0];
  best.forEach((pairs, e) => pairs.forEach(({ score }, b) => {
    if (score > (best[end]?.[back].score ?? 0)) [end, back] = [e, b];
  }));
  const inIt = stack.map(() => false);
  while (back !== 0) {
    inIt[end] = inIt[end - back] = true;
    const { before } = best[end][back];
    [end, back] = [end - back, before];
  }
  return inIt;
}

/** Whether all slices are in that chain, and no two at one place. */
export function isRegular(stack: Stack): boolean {
  if (stack.length < 3) return stack.length < 2 || !areAtOnePlace(stack[0], stack[1]);
  return onRegularSteps(stack).every(Boolean);
}

/** Whether a place is free in a stack: outside of it, or in a hole. */
function isFree(heightMm: number, stack: Stack): boolean {
  const found = stack.findIndex((placed) => placed.heightMm >= heightMm);
  const upper = found < 0 ? stack.length : found;
  if (upper < stack.length && stack[upper].heightMm - heightMm < SAME_PLACE_MM) return false;
  if (upper > 0 && heightMm - stack[upper - 1].heightMm < SAME_PLACE_MM) return false;
  if (upper === 0 || upper === stack.length) return true;
  const gap = (i: number) => stack[i].heightMm - stack[i - 1].heightMm;
  const usual = Math.min(upper >= 2 ? gap(upper - 1) : Infinity, upper + 1 < stack.length ? gap(upper + 1) : Infinity);
  return gap(upper) > HOLE * usual;
}

/** Whether all slices of a part are outside of the stack, or in its holes. */
export function fitsInto(part: Stack, stack: Stack): boolean {
  return part.every(({ heightMm }) => isFree(heightMm, stack));
}
