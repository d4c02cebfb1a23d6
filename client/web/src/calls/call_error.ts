// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { fromBinary, type Message } from "@bufbuild/protobuf";
import type { GenMessage } from "@bufbuild/protobuf/codegenv2";
import { Code, ConnectError } from "@connectrpc/connect";
import { type ErrorInfo, ErrorInfoSchema } from "../generated/google/rpc/error_details_pb";
import { type Status, StatusSchema } from "../generated/google/rpc/status_pb";

/** Codes of gRPC by which this page decides. */
export { Code };

/** A server refuses before anything is done, another one may not. */
const ELSEWHERE = ["SESSION_MOVED", "WRONG_NODE", "SERVER_DRAINING"];

/**
 * A call that failed: the code of gRPC, and the server's reason (docs/service-api.md), "" where it gave none. `message` is a
 * sentence for people. `node`: the server of a cluster that is to be asked instead; "" where it names none.
 */
export class CallError extends Error {
  constructor(
    readonly code: Code,
    message: string,
    readonly reason = "",
    readonly node = "",
  ) {
    super(message);
    this.name = "CallError";
  }

  /** Whether the same call may succeed in a moment: no server answered, or it refused only for now. */
  get isPassing(): boolean {
    // A server that is killed shows as UNAVAILABLE directly, as UNKNOWN or INTERNAL behind proxies.
    return this.isOfServer || this.node !== "" || this.code === Code.DeadlineExceeded || this.reason === "UPLOAD_UNDER_WAY";
  }

  /** Whether it says nothing of the call itself, only that this server does not answer it now. */
  get isOfServer(): boolean {
    return this.code === Code.Unavailable || ELSEWHERE.includes(this.reason) || this.isOfTransport;
  }

  /** Whether another server of the cluster is to be asked; this one has done nothing. */
  get isElsewhere(): boolean {
    return this.isMoved || this.reason === "WRONG_NODE";
  }

  /** Whether that may be done at once. */
  get isMoved(): boolean {
    return this.node !== "" || this.reason === "SESSION_MOVED";
  }

  private get isOfTransport(): boolean {
    return this.reason === "" && (this.code === Code.Unknown || this.code === Code.Internal);
  }
}

/**
 * Of an end frame of a call that this page has not cancelled: `details` are the bytes of a google.rpc.Status, or none. What the
 * server says in them counts: a proxy may end a call in other words. CANCELLED says that something between here and there has
 * gone, so it is UNAVAILABLE.
 */
export function callErrorOf(code: number, message: string, details: Uint8Array): CallError {
  const status = parse(StatusSchema, details);
  const isChanged = status !== undefined && status.code !== code && Code[status.code] !== undefined;
  const [saidCode, said] = isChanged ? [status.code, status.message] : [code, message];
  const info = infoOf(status);
  const text = said === "" ? describe(saidCode) : said;
  return new CallError(saidCode === Code.Canceled ? Code.Unavailable : (saidCode as Code), text, info?.reason ?? "", info?.metadata.node ?? "");
}

/** What a call that this page has not cancelled has failed with, where CANCELLED is UNAVAILABLE, too. */
export function unlessCancelled(thrown: unknown): unknown {
  if (!(thrown instanceof ConnectError) || thrown.code !== Code.Canceled) return thrown;
  const error = new ConnectError(thrown.rawMessage, Code.Unavailable, thrown.metadata, undefined, thrown);
  error.details = thrown.details;
  return error;
}

/** Converts any thrown value to a CallError. */
export function toCallError(thrown: unknown): CallError {
  if (thrown instanceof CallError) return thrown;
  const error = ConnectError.from(thrown);
  const info = error.findDetails(ErrorInfoSchema)[0];
  return new CallError(error.code, error.rawMessage === "" ? describe(error.code) : error.rawMessage, info?.reason ?? "", info?.metadata.node ?? "");
}

/** As a sentence that begins upper case and ends with a full stop: what a person reads. */
export function messageOf(thrown: unknown): string {
  const text = thrown instanceof Error ? thrown.message : String(thrown);
  const sentence = text.charAt(0).toUpperCase() + text.slice(1);
  return /[.!?]$/.test(sentence) ? sentence : `${sentence}.`;
}

function infoOf(status: Status | undefined): ErrorInfo | undefined {
  const info = status?.details.find((detail) => detail.typeUrl.endsWith("/google.rpc.ErrorInfo"));
  return info === undefined ? undefined : parse(ErrorInfoSchema, info.value);
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
