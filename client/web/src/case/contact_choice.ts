// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { create } from "@bufbuild/protobuf";
import { CreateSessionRequestSchema } from "../generated/tissueform/v1/session_service_pb";
import type { ModelInfo } from "../generated/tissueform/v1/server_info_pb";
import { DeformationModel } from "../generated/tissueform/v1/session_pb";
import type { CaseFile } from "./case_file";

const SEALING_MODEL = "linear_elastic";

/** How the lips of a case behave: they part and tissue slides; the same, but closed lips stay closed; or tissue sticks and they are one piece. */
export type ContactChoice = "on" | "sealed" | "off";

/** Of an address ("contact=off"); anything else: "on". */
export function toContactChoice(text: string | null): ContactChoice {
  return text === "off" || text === "sealed" ? text : "on";
}

/** What an address, and what the browser remembers of a session, end with. */
export function contactSuffix(choice: ContactChoice): string {
  return choice === "on" ? "" : `contact=${choice}`;
}

export function contactChoiceOf({ parted, sessionRequest }: Pick<CaseFile, "parted" | "sessionRequest">): ContactChoice {
  if (parted !== null) return "off";
  return sealedPairs({ sessionRequest }) > 0 ? "sealed" : "on";
}

/** Pairs of the lips' edge that are held together; 0: lips are free. */
export function sealedPairs({ sessionRequest: { lipEdge } }: Pick<CaseFile, "sessionRequest">): number {
  return lipEdge?.sealed === true ? lipEdge.pairs.length : 0;
}

/** Those that compute what the case asks for: a seal is computed by linear_elastic alone. */
export function modelsOf(file: Pick<CaseFile, "sessionRequest">, models: readonly ModelInfo[]): readonly ModelInfo[] {
  return sealedPairs(file) === 0 ? models : models.filter(({ name }) => name === SEALING_MODEL);
}

/** Whether the case says which pairs a seal holds together. */
export function canBeSealed({ sessionRequest: { lipEdge } }: Pick<CaseFile, "sessionRequest">): boolean {
  return (lipEdge?.pairs.length ?? 0) > 0;
}

/** The same case with lips that are sealed; as it is where the case does not say which pairs. */
export function sealedCase(file: CaseFile): CaseFile {
  if (!canBeSealed(file)) return file;
  const { sessionRequest: request, manifest } = file;
  const lipEdge = request.lipEdge && { ...request.lipEdge, sealed: true };
  return {
    ...file,
    manifest: { ...manifest, model: SEALING_MODEL },
    sessionRequest: create(CreateSessionRequestSchema, { ...request, model: DeformationModel.LINEAR_ELASTIC, lipEdge }),
  };
}
