// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { CallError, Code } from "./call_error";

/** Of a call: whose session it is about, and which server of a cluster it is for. */
export const SESSION_HEADER = "x-tissueform-session";
export const NODE_HEADER = "x-tissueform-node";

const MOST_SESSIONS = 10_000;
/** As servers are called; nothing else is sent back to one. */
const NODE_NAME = /^[\w.:-]{1,64}$/;
/**
 * So often in a row servers may name a holder which the gateway does not reach: for longer, with the waits in between, than a
 * holder that has died is still named.
 */
const MOST_TURNS = 40;
/** What comes later is not in a row: in between the session was found. */
const LONGEST_TURN_MS = 5000;

/**
 * Which server of a cluster holds which session, as far as answers and errors have shown. Calls name that server; where it has
 * gone, they name none, and the proxy before the servers chooses one. Empty where there is one server.
 */
export class SessionRoutes {
  // Sessions that were heard of last stand last.
  private readonly nodes = new Map<string, string>();
  private hasHeard = false;
  /** Of sessions whose holder the gateway did not reach: which that is, how often, and when last. */
  private readonly strays = new Map<string, { node: string; turns: number; atMs: number }>();

  constructor(private readonly now: () => number = () => performance.now()) {}

  /** Whether any server has reported its name. */
  get isCluster(): boolean {
    return this.hasHeard;
  }

  /** "" where it is not known. `session`: as SESSION_HEADER has it. */
  nodeOf(session: string): string {
    return this.nodes.get(session) ?? "";
  }

  /** What a call of this session is sent with. */
  metadata(session: string): Record<string, string> {
    const node = this.nodeOf(session);
    return node === "" ? {} : { [NODE_HEADER]: node };
  }

  /** `node` answers for the session; "": it has not reported a name. */
  learn(session: string, node: string): void {
    if (!NODE_NAME.test(node)) return;
    this.hasHeard = true;
    if (session === "") return;
    this.nodes.delete(session);
    this.nodes.set(session, node);
    if (this.nodes.size > MOST_SESSIONS) this.nodes.delete(this.nodes.keys().next().value ?? "");
  }

  /**
   * A call that was sent to `node` ("": to none) has failed. What was learned since then stays. Returns what its owner gets to
   * see: the error, or that it leads in a circle.
   */
  failed(session: string, node: string, error: CallError): CallError {
    if (error.node !== "") this.learn(session, error.node);
    else if (error.isOfServer && this.nodeOf(session) === node) this.nodes.delete(session);
    return error.reason === "WRONG_NODE" && this.turn(session, node) > MOST_TURNS ? UNREACHED : error;
  }

  private turn(session: string, node: string): number {
    const last = this.strays.get(session);
    const isNext = last !== undefined && last.node === node && this.now() - last.atMs < LONGEST_TURN_MS;
    const turns = isNext ? last.turns + 1 : 1;
    // A later try starts counting again.
    if (turns > MOST_TURNS) this.strays.delete(session);
    else this.strays.set(session, { node, turns, atMs: this.now() });
    return turns;
  }
}

const UNREACHED = new CallError(
  Code.FailedPrecondition,
  "the proxy before the servers does not know the server of this session; tell the administrator that it needs its name and address",
);

/** Metadata by which a proxy may send all calls of a session to one server. */
export function sessionMetadata(session: string): Record<string, string> {
  return { [SESSION_HEADER]: session.replace(/^(sessions|meshes)\//, "") };
}
