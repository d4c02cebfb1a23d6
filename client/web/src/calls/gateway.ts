// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type Client, type Interceptor, createClient } from "@connectrpc/connect";
import { createGrpcWebTransport } from "@connectrpc/connect-web";
import type { DescMethod, MessageShape } from "@bufbuild/protobuf";
import { AccessService } from "../generated/tissueform/v1/access_service_pb";
import { CaseService } from "../generated/tissueform/v1/case_service_pb";
import { DeformService } from "../generated/tissueform/v1/deform_service_pb";
import { ExportService } from "../generated/tissueform/v1/export_service_pb";
import { MeshService } from "../generated/tissueform/v1/mesh_service_pb";
import { PlanBuildService } from "../generated/tissueform/v1/plan_build_service_pb";
import { PlanService } from "../generated/tissueform/v1/plan_service_pb";
import { PredictionService } from "../generated/tissueform/v1/prediction_service_pb";
import { ServerInfoService } from "../generated/tissueform/v1/server_info_pb";
import { SessionService } from "../generated/tissueform/v1/session_service_pb";
import { Bearer } from "./bearer";
import { CallError, Code, toCallError } from "./call_error";
import { type CallHandlers, type CallOptions, BLOCKED, CallSocket, NOT_OPENED, type Socket, type SocketFactory } from "./call_socket";
import type { Frame } from "./frame";
import { withRoutes } from "./repetition";
import { NODE_HEADER, SESSION_HEADER, SessionRoutes } from "./session_routes";
import { Patience } from "./silence";

export { sessionMetadata } from "./session_routes";

const UNARY_DEADLINE_MS = 60_000;
/** Of the question why a socket did not open. */
const CHECK_MS = 2000;
/** What the gateway answers to a request for a socket that is no upgrade. */
const SOCKETS_ONLY = 426;

/** Where the page of this address lies, without the last slash: at the root of its host, or below a path that a proxy has for it. */
export function baseOf(url: string): string {
  return new URL(".", url).href.replace(/\/$/, "");
}

/**
 * The page's own gateway: services for unary calls and bounded downloads over gRPC-Web, `open` for what lives long, over a
 * socket of its own. The token of `bearer` goes with every call, and the name of the server that holds its session. Where the server does not take it and there is another one, a
 * unary call is made again with that, and a call over a socket ends with an error that passes.
 */
export class Gateway {
  /** Where the sessions of this page's calls are. */
  readonly routes = new SessionRoutes();
  /** By the name of a method. */
  private readonly patience = new Map<string, Patience>();
  readonly access: Client<typeof AccessService>;
  readonly cases: Client<typeof CaseService>;
  readonly meshes: Client<typeof MeshService>;
  readonly sessions: Client<typeof SessionService>;
  readonly plans: Client<typeof PlanService>;
  readonly planBuilds: Client<typeof PlanBuildService>;
  readonly predictions: Client<typeof PredictionService>;
  readonly deform: Client<typeof DeformService>;
  readonly exports: Client<typeof ExportService>;
  readonly serverInfo: Client<typeof ServerInfoService>;

  /** `base`: where the page comes from, as "http://127.0.0.1:8080" or "https://hospital.example.org/planner". */
  constructor(
    readonly base: string,
    readonly bearer: Bearer = new Bearer(),
    private readonly sockets: SocketFactory = () => webSocket(base),
  ) {
    const transport = createGrpcWebTransport({
      baseUrl: base,
      useBinaryFormat: true,
      defaultTimeoutMs: UNARY_DEADLINE_MS,
      interceptors: [withRoutes(this.routes), withToken(bearer)],
    });
    this.access = createClient(AccessService, transport);
    this.cases = createClient(CaseService, transport);
    this.meshes = createClient(MeshService, transport);
    this.sessions = createClient(SessionService, transport);
    this.plans = createClient(PlanService, transport);
    this.planBuilds = createClient(PlanBuildService, transport);
    this.predictions = createClient(PredictionService, transport);
    this.deform = createClient(DeformService, transport);
    this.exports = createClient(ExportService, transport);
    this.serverInfo = createClient(ServerInfoService, transport);
  }

  open<M extends DescMethod>(method: M, handlers: CallHandlers<MessageShape<M["output"]>>, options?: CallOptions): CallSocket<M> {
    const { token } = this.bearer;
    const session = options?.metadata?.[SESSION_HEADER] ?? "";
    const route = this.routes.metadata(session);
    const onBegin = (headers: Record<string, string>) => this.routes.learn(session, headers[NODE_HEADER] ?? "");
    const onEnd = (ended: CallError | null) => {
      const error = ended === null ? null : this.routes.failed(session, route[NODE_HEADER] ?? "", ended);
      if (error?.code === Code.Unauthenticated) void this.refused(error, token, (refusal) => handlers.onEnd(refusal));
      else if (error?.reason === NOT_OPENED) void this.explained(error).then((explanation) => handlers.onEnd(explanation));
      else handlers.onEnd(error);
    };
    const metadata = { ...this.bearer.headers, ...options?.metadata, ...route };
    const routed = { onBegin, onMessage: (message: MessageShape<M["output"]>, frame: Frame) => handlers.onMessage(message, frame), onQuiet: (isQuiet: boolean) => handlers.onQuiet?.(isQuiet), onEnd };
    return new CallSocket(this.sockets, method, routed, { patience: this.patienceOf(method.name), ...options, metadata });
  }

  private patienceOf(method: string): Patience {
    const patience = this.patience.get(method) ?? new Patience();
    this.patience.set(method, patience);
    return patience;
  }

  /** Why a socket did not open: where the gateway answers a plain request for one, something before it keeps sockets back. */
  private async explained(error: CallError): Promise<CallError> {
    const options: RequestInit = { cache: "no-store", signal: AbortSignal.timeout(CHECK_MS) };
    const status = await fetch(`${this.base}/call`, options).then((reply) => reply.status, () => 0);
    if (status === 503) return new CallError(error.code, "the gateway takes no more connections now", NOT_OPENED);
    if (status !== SOCKETS_ONLY) return error;
    return new CallError(error.code, "a proxy blocks WebSockets: tell the administrator (docs/gateway.md)", BLOCKED);
  }

  private async refused(error: CallError, token: string, onEnd: (error: CallError) => void): Promise<void> {
    const isReplaced = await this.bearer.replace(token, error.message);
    onEnd(isReplaced ? new CallError(Code.Unavailable, "the login is being renewed") : error);
  }

  /**
   * A call of one request with answers in between: `onMessage` receives each; resolves at the call's end, rejects with a
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

/** Of unary calls and downloads. */
function withToken(bearer: Bearer): Interceptor {
  return (next) => async (request) => {
    const { token } = bearer;
    const ask = () => {
      Object.entries(bearer.headers).forEach(([name, value]) => request.header.set(name, value));
      return next(request);
    };
    try {
      return await ask();
    } catch (thrown) {
      // The messages of a stream are gone once they were sent.
      const { code, message } = toCallError(thrown);
      const isRefused = code === Code.Unauthenticated && !request.stream;
      if (!isRefused || !(await bearer.replace(token, message))) throw thrown;
      return ask();
    }
  };
}

function webSocket(base: string): Socket {
  return new WebSocket(`${base.replace(/^http/, "ws")}/call`, "tissueform.v1") as unknown as Socket;
}
