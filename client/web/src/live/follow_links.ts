// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { toCallError } from "../calls/call_error";
import { type Gateway, sessionMetadata } from "../calls/gateway";

/** What a follower opens. */
export interface FollowLink {
  url: string;
  /** Null: with its session. */
  endsAt: Date | null;
}

/** What a follow link's token begins with; the names of sessions do not. */
const TOKEN_PREFIX = "tfl_";

export function isLinkToken(text: string): boolean {
  return text.startsWith(TOKEN_PREFIX);
}

/** A requested link is replaced by a new one when so little of its life is left. */
const LEAST_LEFT_MS = 3_600_000;

/** Links by which others follow this page's session and see its case. All reject with a CallError. */
export class FollowLinks {
  private made: (FollowLink & { session: string }) | null = null;

  /** `hasLogins`: where not, the session's name is the link. `url` makes an address of a session's name or a token. */
  constructor(
    private readonly gateway: { access: Pick<Gateway["access"], "createFollowLink" | "deleteFollowLinks"> },
    readonly hasLogins: boolean,
    private readonly caseName: string,
    private readonly session: () => string,
    private readonly url: (sessionOrToken: string) => string,
    private readonly now: () => number = () => Date.now(),
  ) {}

  /** The one of before where that lasts. */
  async make(): Promise<FollowLink> {
    const session = this.session();
    if (!this.hasLogins) return { url: this.url(session.replace("sessions/", "")), endsAt: null };
    const leftMs = (this.made?.endsAt?.getTime() ?? 0) - this.now();
    if (this.made === null || this.made.session !== session || leftMs < LEAST_LEFT_MS) this.made = await this.create(session);
    return this.made;
  }

  /** Also those that were made before this page was loaded. */
  async endAll(): Promise<void> {
    const session = this.session();
    this.made = null;
    await this.gateway.access.deleteFollowLinks({ session }, { headers: sessionMetadata(session) }).catch((thrown) => Promise.reject(toCallError(thrown)));
  }

  private async create(session: string): Promise<FollowLink & { session: string }> {
    const request = this.gateway.access.createFollowLink({ session, case: this.caseName }, { headers: sessionMetadata(session) });
    const { token, expireTime } = await request.catch((thrown) => Promise.reject(toCallError(thrown)));
    return { session, url: this.url(token), endsAt: new Date(1000 * Number(expireTime?.seconds ?? 0n)) };
  }
}
