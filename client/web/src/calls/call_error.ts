// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { fromBinary, type Message } from "@bufbuild/protobuf";
import type { GenMessage } from "@bufbuild/protobuf/codegenv2";
import { Code, ConnectError } from "@connectrpc/connect";
import { ErrorInfoSchema } from "../generated/google/rpc/error_details_pb";
import { StatusSchema } from "../generated/google/rpc/status_pb";

/** Codes of gRPC by which this page decides. */
export { Code };

/**
 * A call that failed: the code of gRPC, and the server's reason (docs/service-api.md), "" where it gave none. `message` is a
 * sentence for people.
 */
export class CallError extends Error {
  constructor(
    readonly code: Code,
    message: string,
    readonly reason = "",
  ) {
    super(message);
    this.name = "CallError";
  }

  /** Whether the same call may succeed in a moment: nobody answered, or not for now. */
  get isPassing(): boolean {
    // A server that is killed shows as UNAVAILABLE directly, as UNKNOWN or INTERNAL behind proxies.
    return this.code === Code.Unavailable || this.code === Code.DeadlineExceeded || this.reason === "UPLOAD_UNDER_WAY" || this.isOfTransport;
  }

  private get isOfTransport(): boolean {
    return this.reason === "" && (this.code === Code.Unknown || this.code === Code.Internal);
  }
}

/** Of an end frame: `details` are the bytes of a google.rpc.Status, or none. */
export function callErrorOf(code: number, message: string, details: Uint8Array): CallError {
  return new CallError(code as Code, message === "" ? describe(code) : message, reasonOf(details));
}

/** Whatever was thrown, as a CallError. */
export function toCallError(thrown: unknown): CallError {
  if (thrown instanceof CallError) return thrown;
  const error = ConnectError.from(thrown);
  const info = error.findDetails(ErrorInfoSchema)[0];
  return new CallError(error.code, error.rawMessage === "" ? describe(error.code) : error.rawMessage, info?.reason ?? "");
}

/** As a sentence that begins upper case and ends with a full stop: what a person reads. */
export function sentenceOf(thrown: unknown): string {
  const text = thrown instanceof Error ? thrown.message : String(thrown);
  const sentence = text.charAt(0).toUpperCase() + text.slice(1);
  return /[.!?]$/.test(sentence) ? sentence : `${sentence}.`;
}

function reasonOf(details: Uint8Array): string {
  const status = parse(StatusSchema, details);
  const info = status?.details.find((detail) => detail.typeUrl.endsWith("/google.rpc.ErrorInfo"));
  return info === undefined ? "" : (parse(ErrorInfoSchema, info.value)?.reason ?? "");
}

// Details are an addition: an answer is not refused for details that cannot be read.
function parse<M extends Message>(schema: GenMessage<M>, bytes: Uint8Array): M | undefined {
  try {
    return fromBinary(schema, bytes);
  } catch {
    return undefined;
  }
}

function describe(code: number): string {
  const name = Code[code];
  return name === undefined ? `the call ended with the unknown code ${code}` : `the call ended: ${name}`;
}
