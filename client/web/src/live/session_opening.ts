// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { create } from "@bufbuild/protobuf";
import { CallError, Code, toCallError } from "../calls/call_error";
import { type Gateway, sessionMetadata } from "../calls/gateway";
import type { CaseFile } from "../case/case_file";
import { type DeformConfiguration, type MaterialRanges, DeformConfigurationSchema, type PreparedAnswers, PreparedAnswersSchema } from "../generated/tissueform/v1/deform_service_pb";
import { CreateSessionRequestSchema, PrepareSessionRequestSchema, type PrepareSessionRequest, PreparationStage, SessionService } from "../generated/tissueform/v1/session_service_pb";
import type { DeformationModel, Session } from "../generated/tissueform/v1/session_pb";
import { isMissing, uploadMesh } from "./upload";

/** What is going on, in words for the person who waits, and how far it is where that is known. */
export type OnStage = (text: string, share: number | null) => void;

const STAGES: Record<PreparationStage, string> = {
  [PreparationStage.UNSPECIFIED]: "Preparing",
  [PreparationStage.READING_MESH]: "Reading the mesh",
  [PreparationStage.WAITING]: "Waiting for the server's turn",
  [PreparationStage.ASSEMBLING]: "Assembling the soft tissue",
  [PreparationStage.ORDERING]: "Ordering the equations",
  [PreparationStage.FACTORISING]: "Factorising",
  [PreparationStage.RESPONSES]: "Preparing responses",
  [PreparationStage.KEEPING]: "Storing the session",
  [PreparationStage.ANSWERS]: "Preparing answers",
};

/** The largest turn that prepared answers cover; what is turned further is solved directly. */
const PREPARED_ROTATION = (35 * Math.PI) / 180;
const MAX_UNACKED = 3;

/** 128 random bits, in hexadecimal digits. */
export function randomId(): string {
  return Array.from(crypto.getRandomValues(new Uint8Array(16)), (byte) => byte.toString(16).padStart(2, "0")).join("");
}

export interface DragChoice {
  /** Undefined: the session's own. */
  model?: DeformationModel;
  isPrepared: boolean;
  /** With the band of uncertainty. */
  ranges: MaterialRanges | null;
}

/** What a drag of this case asks for. */
export function dragConfiguration(session: string, file: CaseFile, choice: DragChoice): DeformConfiguration {
  const prepared: PreparedAnswers | undefined = choice.isPrepared
    ? create(PreparedAnswersSchema, { maxRotation: PREPARED_ROTATION, ranges: choice.ranges ?? undefined })
    : undefined;
  return create(DeformConfigurationSchema, {
    session,
    vertices: { selection: { case: "list", value: { vertices: Array.from(file.followed) } } },
    maxUnacked: MAX_UNACKED,
    model: choice.model,
    prepared,
  });
}

/** Rejects with a CallError; SESSION_NOT_FOUND where the server has it no longer. */
export async function openSession(gateway: Gateway, session: string, stream: DeformConfiguration, onStage: OnStage): Promise<Session> {
  return prepare(gateway, session, create(PrepareSessionRequestSchema, { what: { case: "open", value: session }, stream }), onStage);
}

/** A new session of the case; sends the mesh where the server does not have it. Rejects with a CallError. */
export async function createSession(gateway: Gateway, file: CaseFile, stream: DeformConfiguration, onStage: OnStage): Promise<Session> {
  const sessionId = stream.session.replace("sessions/", "");
  const value = create(CreateSessionRequestSchema, { ...file.sessionRequest, sessionId, requestId: sessionId });
  const request = create(PrepareSessionRequestSchema, { what: { case: "create", value }, stream });
  try {
    return await prepare(gateway, stream.session, request, onStage);
  } catch (thrown) {
    if (!isMissing(thrown, "MESH_NOT_FOUND")) throw thrown;
  }
  await uploadMesh(gateway, file.meshSource, file.meshPayload, file.manifest.mesh, (share) => onStage("Sending the mesh", share));
  return prepare(gateway, stream.session, request, onStage);
}

async function prepare(gateway: Gateway, session: string, request: PrepareSessionRequest, onStage: OnStage): Promise<Session> {
  let result: Session | null = null;
  await gateway.stream(
    SessionService.method.prepareSession,
    request,
    ({ message }) => {
      if (message.case === "session") result = message.value;
      if (message.case === "progress") {
        const { stage, step, steps } = message.value;
        onStage(STAGES[stage] ?? STAGES[PreparationStage.UNSPECIFIED], steps === 0n ? null : Number(step) / Number(steps));
      }
    },
    { metadata: sessionMetadata(session) },
  );
  if (result === null) throw new CallError(Code.DataLoss, "the server prepared the session without reporting it");
  return result;
}

/** Deletes a session that is no longer needed; it is not an error if it is gone already. */
export async function deleteSession(gateway: Gateway, session: string): Promise<void> {
  try {
    await gateway.sessions.deleteSession({ name: session }, { headers: sessionMetadata(session) });
  } catch (thrown) {
    if (toCallError(thrown).code !== Code.NotFound) throw thrown;
  }
}
