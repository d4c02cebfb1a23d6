// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type CallError, messageOf } from "../calls/call_error";
import { BLOCKED } from "../calls/call_socket";
import type { SessionRoutes } from "../calls/session_routes";

/** How the page and the server stand to each other, for who draws it in words. */
export type Connection =
  | { kind: "preparing"; text: string; share: number | null }
  | { kind: "live" }
  /** Open, and what is waited for does not come: an answer, or any sign of the server. */
  | { kind: "waiting" }
  /** Another server of the cluster is about to take the session: it goes on by itself within seconds. */
  | { kind: "moving" }
  | { kind: "broken"; text: string }
  | { kind: "failed"; text: string };

/** Longer than a lease, a preparation and some tries. */
const MOVING_MS = 30_000;

/** Reports a call that broke off as a move where there is a cluster, as long as that is likely, and by its error otherwise. */
export class Interruption {
  private since: number | null = null;

  constructor(
    private readonly routes: Pick<SessionRoutes, "isCluster">,
    private readonly now: () => number = () => performance.now(),
  ) {}

  /** The call goes on. */
  end(): void {
    this.since = null;
  }

  /** It has broken off, or not come back. */
  connection(error: CallError): Connection {
    this.since ??= this.now();
    const isLong = this.now() - this.since > MOVING_MS;
    if (!isLong && error.reason !== BLOCKED && (error.isElsewhere || this.routes.isCluster)) return { kind: "moving" };
    return { kind: "broken", text: messageOf(error) };
  }
}
