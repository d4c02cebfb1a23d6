// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { create } from "@bufbuild/protobuf";
import { expect, test } from "vitest";
import { canBeSealed, contactChoiceOf, contactSuffix, modelsOf, sealedCase, sealedPairs, toContactChoice } from "../../src/case/contact_choice";
import type { CaseFile } from "../../src/case/case_file";
import type { ModelInfo } from "../../src/generated/tissueform/v1/server_info_pb";
import { CreateSessionRequestSchema } from "../../src/generated/tissueform/v1/session_service_pb";
import { DeformationModel } from "../../src/generated/tissueform/v1/session_pb";

const lipEdge = { up: { x: 0, y: 0, z: 1 }, pairs: [{ upper: 5, lower: 2 }, { upper: 6, lower: 3 }] };
const models = [{ name: "gradient_field" }, { name: "linear_elastic" }] as ModelInfo[];

/** What of a case the choice is about. */
function caseOf(fields: object): CaseFile {
  return { manifest: { model: "neo_hookean" }, parted: null, sessionRequest: create(CreateSessionRequestSchema, { model: DeformationModel.NEO_HOOKEAN, ...fields }) } as unknown as CaseFile;
}

test("addresses say the choice, and others than these are that lips part", () => {
  for (const choice of ["sealed", "off"] as const) expect(toContactChoice(new URLSearchParams(contactSuffix(choice)).get("contact"))).toBe(choice);
  expect(contactSuffix("on")).toBe("");
  expect(toContactChoice(null)).toBe("on");
  expect(toContactChoice("open")).toBe("on");
});

test("a sealed case asks for the seal by the one model that computes it, and leaves the opened case as it was", () => {
  const file = caseOf({ lipEdge });
  const sealed = sealedCase(file);
  expect(sealed.sessionRequest.lipEdge?.sealed).toBe(true);
  expect(sealed.sessionRequest.lipEdge?.pairs.map(({ upper, lower }) => [upper, lower])).toEqual([[5, 2], [6, 3]]);
  expect(sealed.sessionRequest.model).toBe(DeformationModel.LINEAR_ELASTIC);
  expect(sealed.manifest.model).toBe("linear_elastic");
  expect([contactChoiceOf(sealed), sealedPairs(sealed)]).toEqual(["sealed", 2]);
  expect(modelsOf(sealed, models).map(({ name }) => name)).toEqual(["linear_elastic"]);
  expect([contactChoiceOf(file), sealedPairs(file), file.manifest.model]).toEqual(["on", 0, "neo_hookean"]);
  expect(modelsOf(file, models)).toHaveLength(2);
});

test("a case without pairs stays as it is", () => {
  const file = caseOf({});
  expect(canBeSealed(file)).toBe(false);
  expect(sealedCase(file)).toBe(file);
});
