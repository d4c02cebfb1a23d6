// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { CallError } from "./call_error";

/** Of a call: whose session it is about, and which server of a cluster it is for. */
export const SESSION_HEADER = "x-tissueform-session";
export const NODE_HEADER = "x-tissueform-node";

const MOST_SESSIONS = 10_000;
/** As servers are called; nothing else is sent back to one. */
const NODE_NAME = /^[\w.:-]{1,64}$/;

/**
 * Which server of a cluster holds which session, as far as answers and errors have told. Calls name that server; where it has
 * gone, they name none and are sent on by whoever stands before the servers. Empty where there is one server.
 */
export class SessionRoutes {
  // Sessions that were heard of last stand last.
  private readonly nodes = new Map<string, string>();
  private hasHeard = false;

  /** Whether any server has told its name. */
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

  /** `node` answers for the session; "": it has told no name. */
  learn(session: string, node: string): void {
    if (!NODE_NAME.test(node)) return;
    this.hasHeard = true;
    if (session === "") return;
    this.nodes.delete(session);
    this.nodes.set(session, node);
    if (this.nodes.size > MOST_SESSIONS) this.nodes.delete(this.nodes.keys().next().value ?? "");
  }

  /** A call that was sent to `node` ("": to none) has failed. What was learned since then stays. */
  failed(session: string, node: string, error: CallError): void {
    if (error.node !== "") this.learn(session, error.node);
    else if (error.isOfServer && this.nodeOf(session) === node) this.nodes.delete(session);
  }
}

/** Metadata by which a proxy may send all calls of a session to one server. */
export function sessionMetadata(session: string): Record<string, string> {
  return { [SESSION_HEADER]: session.replace(/^(sessions|meshes)\//, "") };
}
