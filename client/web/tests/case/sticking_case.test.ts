// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { expect, test } from "vitest";
import { type CaseFile, openCase } from "../../src/case/case_file";
import { firstAtPlace, keptCount } from "../../src/case/sticking";
import { stickingCase } from "../../src/case/sticking_case";
import { planOf } from "../../src/exports/case_plan";
import { handMadeCase } from "../testing/hand_made_case";
import { sourceOf } from "../testing/small_case";

const open = (hasContact: boolean) => openCase(sourceOf(handMadeCase(hasContact)));
const payloadOf = ({ meshSource, meshPayload }: CaseFile) => meshSource.read(meshPayload.offset, meshPayload.length);

test("a case with contact is read with its rows and with what sticks without them", async () => {
  const file = await open(true);
  const whole = await open(false);
  const doubles = file.manifest.mesh.vertexCount - whole.manifest.mesh.vertexCount;
  expect(doubles).toBe(20);
  expect(file.sessionRequest.contact.length).toBe(file.manifest.contact?.rows);
  expect(file.sticking.length / 2).toBe(file.sessionRequest.contact.length - doubles);
  expect(file.sessionRequest.handles[0].vertices).not.toContain(file.sticking[0]);
});

const followedBySkin = ({ followed, surfaces }: CaseFile) => surfaces[0].follows?.places.map((place) => followed[place]);

test("without contact it is the case that was made without a seam, to the byte", async () => {
  const joined = await stickingCase(await open(true));
  const whole = await open(false);
  expect(joined.manifest.mesh).toEqual({ ...whole.manifest.mesh, payload: joined.manifest.mesh.payload });
  expect(await payloadOf(joined)).toEqual(await payloadOf(whole));
  expect({ ...joined.sessionRequest, model: whole.sessionRequest.model }).toEqual(whole.sessionRequest);
  expect(followedBySkin(joined)).toEqual(followedBySkin(whole));
  expect(joined.restPositions).toEqual(whole.restPositions);
  expect(joined.parted?.manifest.contact).not.toBeNull();
});

test("lips whose doubles are not the last vertices cannot be joined", async () => {
  const file = await open(true);
  const last = file.manifest.mesh.vertexCount - 1;
  file.sessionRequest.contact = file.sessionRequest.contact.filter(({ vertex }) => vertex !== last);
  await expect(stickingCase(file)).rejects.toThrow("the doubles of the seam are not the last vertices");
});

test("a chain of doubles ends at its first vertex, and apart is not joined", () => {
  const row = (vertex: number, value: number) => ({ vertex, other: { case: "otherVertex" as const, value } });
  const positions = [0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0];
  const first = firstAtPlace(positions, [row(2, 0), row(3, 2), row(1, 0)] as never);
  expect(Array.from(first)).toEqual([0, 1, 0, 0]);
  expect(keptCount(first)).toBe(2);
});

test.each([
  ["a damaged list of what sticks", (file: Uint8Array) => patched(file, '"sticking":9', '"sticking":8'), "stick without contact are damaged"],
  ["other numbers of rows", (file: Uint8Array) => patched(file, /"rows":(\d+)/, '"rows":99'), "contact rows, and the case says 99"],
])("%s is refused", async (_, damage, reason) => {
  await expect(openCase(sourceOf(damage(handMadeCase(true))))).rejects.toThrow(reason);
});

/** The JSON with something else of the same length. */
function patched(file: Uint8Array, from: string | RegExp, to: string): Uint8Array<ArrayBuffer> {
  const text = new TextDecoder("latin1").decode(file);
  const changed = text.replace(from, to);
  expect(changed.length).toBe(text.length);
  return Uint8Array.from(changed, (letter) => letter.charCodeAt(0));
}

test("its plan has the rows, and regions that hold what sticks; so has the plan of the case without contact", async () => {
  const file = await open(true);
  const plan = planOf(file, new Map(), "linear_elastic", null) as { version: number; contact: { rows: object[] }; handles: { region: { vertices: number[] } }[] };
  const whole = await open(false);
  expect(plan.version).toBe(4);
  expect(plan.contact.rows.length).toBe(file.sessionRequest.contact.length);
  expect(plan.contact.rows[0]).toEqual({ vertex: whole.manifest.mesh.vertexCount, other_vertex: file.sessionRequest.contact[0].other.value, normal: [0, 0, -1] });
  expect(plan.contact.rows.at(-1)).toEqual({ vertex: file.sticking.at(-2), handle: "mandible", normal: [0, -1, 0], bilateral: true });
  expect(plan.handles[0].region.vertices).toEqual(whole.sessionRequest.handles[0].vertices);
  expect(planOf(await stickingCase(file), new Map(), "linear_elastic", null)).toEqual(plan);
});
