// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type Client, createClient } from "@connectrpc/connect";
import { createGrpcWebTransport } from "@connectrpc/connect-web";
import type { DescMethod, MessageShape } from "@bufbuild/protobuf";
import { CaseService } from "../generated/tissueform/v1/case_service_pb";
import { DeformService } from "../generated/tissueform/v1/deform_service_pb";
import { MeshService } from "../generated/tissueform/v1/mesh_service_pb";
import { PredictionService } from "../generated/tissueform/v1/prediction_service_pb";
import { ServerInfoService } from "../generated/tissueform/v1/server_info_pb";
import { SessionService } from "../generated/tissueform/v1/session_service_pb";
import type { CallError } from "./call_error";
import { type CallHandlers, type CallOptions, CallSocket, type Socket, type SocketFactory } from "./call_socket";

const UNARY_DEADLINE_MS = 60_000;

/**
 * The page's own gateway: services for unary calls and bounded downloads over gRPC-Web, `open` for what lives long, over a
 * socket of its own.
 */
export class Gateway {
  readonly cases: Client<typeof CaseService>;
  readonly meshes: Client<typeof MeshService>;
  readonly sessions: Client<typeof SessionService>;
  readonly predictions: Client<typeof PredictionService>;
  readonly deform: Client<typeof DeformService>;
  readonly serverInfo: Client<typeof ServerInfoService>;

  /** `base`: where the page comes from, as "http://127.0.0.1:8080". */
  constructor(
    readonly base: string,
    private readonly sockets: SocketFactory = () => webSocket(base),
  ) {
    const transport = createGrpcWebTransport({ baseUrl: base, useBinaryFormat: true, defaultTimeoutMs: UNARY_DEADLINE_MS });
    this.cases = createClient(CaseService, transport);
    this.meshes = createClient(MeshService, transport);
    this.sessions = createClient(SessionService, transport);
    this.predictions = createClient(PredictionService, transport);
    this.deform = createClient(DeformService, transport);
    this.serverInfo = createClient(ServerInfoService, transport);
  }

  open<M extends DescMethod>(method: M, handlers: CallHandlers<MessageShape<M["output"]>>, options?: CallOptions): CallSocket<M> {
    return new CallSocket(this.sockets, method, handlers, options);
  }

  /**
   * A call of one request with answers in between: `onMessage` is told of each; resolves at the call's end, rejects with a
   * CallError. An aborted `signal` cancels it.
   */
  stream<M extends DescMethod>(
    method: M,
    request: MessageShape<M["input"]>,
    onMessage: (message: MessageShape<M["output"]>) => void,
    options: CallOptions & { signal?: AbortSignal } = {},
  ): Promise<void> {
    return new Promise((resolve, reject) => {
      const onEnd = (error: CallError | null) => (error === null ? resolve() : reject(error));
      const call = this.open(method, { onMessage, onEnd }, options);
      options.signal?.addEventListener("abort", () => {
        call.cancel();
        reject(options.signal?.reason);
      });
      call.send(request);
      call.halfClose();
    });
  }
}

/** Metadata by which a proxy may send all calls of a session to one server. */
export function sessionMetadata(session: string): Record<string, string> {
  return { "x-tissueform-session": session.replace(/^sessions\//, "") };
}

function webSocket(base: string): Socket {
  return new WebSocket(`${base.replace(/^http/, "ws")}/call`, "tissueform.v1") as unknown as Socket;
}
