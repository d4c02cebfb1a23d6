// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { create } from "@bufbuild/protobuf";
import { expect, test } from "vitest";
import { SolveSummarySchema } from "../../src/generated/tissueform/v1/deform_service_pb";
import { NewestAnswer } from "../../src/workbench/newest_answer";

const REST = Float32Array.of(1, 2, 3, 4, 5, 6);
const at = (shift: number) => REST.map((value) => value + shift);
const band = (...mm: number[]) => Float32Array.from(mm);

function picture(shift: number, uncertainty: Float32Array | null, more: { posesBehind?: number; refinement?: number } = {}) {
  return { positions: at(shift), uncertainty, posesBehind: more.posesBehind ?? 0, frame: { refinement: more.refinement ?? 0, refining: true, summary: create(SolveSummarySchema, { prepared: true }) } };
}

function own(shift: number, uncertainty: Float32Array | null) {
  return { positions: at(shift), uncertainty, errorBoundMm: 0.25, isEstimate: true };
}

test("the band is that of the newest answer, the page's own as well as the server's", () => {
  const answer = new NewestAnswer(REST);
  expect(answer.uncertainty).toBeNull();
  answer.takePicture(picture(1, band(0.5, 0.25)), Infinity);
  expect(answer.uncertainty).toEqual(band(0.5, 0.25));
  expect(answer.takeOwn(own(2, band(1, 0.75)))).toBe(true);
  expect(answer.uncertainty).toEqual(band(1, 0.75));
  expect(answer.displacements).toEqual(REST.map(() => 2));
});

test("an answer without a band leaves none of an older one", () => {
  const answer = new NewestAnswer(REST);
  answer.takePicture(picture(1, band(0.5, 0.25)), Infinity);
  answer.takeOwn(own(2, null));
  expect(answer.uncertainty).toBeNull();
});

test("later changes to the evaluator's arrays do not matter", () => {
  const answer = new NewestAnswer(REST);
  const theirs = band(1, 2);
  answer.takeOwn(own(1, theirs));
  theirs.fill(9);
  expect(answer.uncertainty).toEqual(band(1, 2));
});

test("a refinement keeps the band of the answer that it refines", () => {
  const answer = new NewestAnswer(REST);
  answer.takePicture(picture(1, band(0.5, 0.25)), Infinity);
  answer.takePicture(picture(1.5, null, { refinement: 1 }), Infinity);
  expect(answer.uncertainty).toEqual(band(0.5, 0.25));
  expect(answer.displacements[0]).toBe(1.5);
});

test("the server does not take the face back behind what the page has answered, and confirms what is as new", () => {
  const answer = new NewestAnswer(REST);
  answer.takeOwn(own(2, band(1, 1)));
  expect(answer.takePicture(picture(1, band(0.5, 0.5), { posesBehind: 1 }), 0)).toBe(false);
  expect([answer.displacements[0], answer.uncertainty?.[0]]).toEqual([2, 1]);
  expect(answer.takePicture(picture(2.5, band(1.5, 1.5)), 0)).toBe(true);
  expect([answer.displacements[0], answer.uncertainty?.[0]]).toEqual([2.5, 1.5]);
});

test("the face names its source: an older answer of the server does not replace it, one that confirms does", () => {
  const answer = new NewestAnswer(REST);
  expect(answer.answer).toBeNull();
  answer.takePicture(picture(1, null), Infinity);
  expect(answer.answer).toMatchObject({ by: "server", isRefining: true, summary: { prepared: true } });
  answer.takeOwn(own(2, null));
  expect(answer.answer).toEqual({ by: "page", errorBoundMm: 0.25, isEstimate: true });
  answer.takePicture(picture(1, null, { posesBehind: 1 }), 0);
  expect(answer.answer?.by).toBe("page");
  answer.takePicture(picture(2, null), 0);
  expect(answer.answer?.by).toBe("server");
});

test("answers of other vertices are not taken", () => {
  const answer = new NewestAnswer(REST);
  expect(answer.takeOwn({ ...own(0, null), positions: REST.slice(3) })).toBe(false);
  expect(() => answer.takePicture({ ...picture(0, null), positions: REST.slice(3) }, Infinity)).toThrow("other vertices");
});
