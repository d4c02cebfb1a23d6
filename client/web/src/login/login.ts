// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Bearer } from "../calls/bearer";
import { messageOf } from "../calls/call_error";
import { type LoginPage, type Redirect, browserPage, isSignedOut, keepRedirect, markSignedOut, redirectUri, takeAnswer, takeRedirect } from "./redirect";
import { type Provider, type Tokens, type User, isRefusal, loginSentence, needsUser, newSecrets } from "./provider";

/** How the user and the server stand to each other. */
export type LoginState =
  /** Not signed in; `problem`: why, "" where nothing went wrong. */
  | { kind: "out"; problem: string }
  /** On the way to the provider, or back from it. */
  | { kind: "asking" }
  | { kind: "in"; name: string }
  /** Signed in, but soon not any more. */
  | { kind: "ending"; name: string; text: string }
  | { kind: "ended"; name: string; text: string };

/** Runs `action` after a while; the result stops it. */
type Timer = (action: () => void, delayMs: number) => () => void;

const browserTimer: Timer = (action, delayMs) => {
  const id = setTimeout(action, delayMs);
  return () => clearTimeout(id);
};

/** A token is renewed so long before it ends, or when a third of its life is left. */
const RENEWED_BEFORE_MS = 60_000;
const RETRY_MS = 5000;

/**
 * Who uses this page. The token lies in `bearer` and in no storage; so a page that is loaded again asks the provider again, which
 * knows its user and asks them nothing. Errors are states; nothing is thrown.
 */
export class Login {
  private current: LoginState = { kind: "asking" };
  private readonly listeners: ((state: LoginState) => void)[] = [];
  private user: User | null = null;
  private tokens: Tokens | null = null;
  private endsAt = 0;
  private stopTimer: (() => void) | null = null;
  private renewal: Promise<boolean> | null = null;
  /** The token of now came in place of one that the server did not take. */
  private isReplacement = false;
  /** What the user had under their hands before the login; null where nothing was. */
  work: unknown = null;

  constructor(
    private readonly provider: Provider,
    private readonly issuer: string,
    private readonly bearer: Bearer,
    private readonly page: LoginPage = browserPage,
    private readonly timer: Timer = browserTimer,
    private readonly now: () => number = () => Date.now(),
  ) {
    bearer.renewer = (why) => this.replace(why);
  }

  get state(): LoginState {
    return this.current;
  }

  /** Notifies `listener` now, and of every change. */
  watch(listener: (state: LoginState) => void): void {
    this.listeners.push(listener);
    listener(this.current);
  }

  /** To be called once, first: ends as "in", as "out", or leaves the page for the provider. */
  async begin(): Promise<void> {
    const redirect = takeRedirect(this.page);
    const answer = takeAnswer(this.page, redirect?.hash ?? this.page.url.hash);
    if (answer !== null) return this.arrive(answer, redirect);
    if (isSignedOut(this.page)) return this.become({ kind: "out", problem: "" });
    return this.leave(true, null);
  }

  /** Leaves the page for the provider. `work` is there again afterwards. */
  async signIn(work: unknown = this.work): Promise<void> {
    markSignedOut(this.page, false);
    await this.leave(false, work);
  }

  /** Here, and at the provider where it lets us; leaves the page. */
  async signOut(): Promise<void> {
    const { user } = this;
    this.forget();
    markSignedOut(this.page, true);
    const uri = redirectUri(this.page);
    const url = user === null ? null : await this.provider.endSessionUrl(user, uri).catch(() => null);
    this.page.go(url ?? uri);
  }

  private async arrive(answer: URLSearchParams, redirect: Redirect | null): Promise<void> {
    if (redirect === null) return this.become({ kind: "out", problem: "No login was started in this tab. Sign in here." });
    this.work = redirect.work ?? null;
    try {
      const { user, ...tokens } = await this.provider.exchange(answer, redirect, redirectUri(this.page));
      this.user = user;
      this.take(tokens);
    } catch (thrown) {
      const isExpected = redirect.isSilent && needsUser(thrown);
      this.become({ kind: "out", problem: isExpected ? "" : loginSentence(thrown, this.issuer) });
    }
  }

  private async leave(isSilent: boolean, work: unknown): Promise<void> {
    const before = this.current;
    const { hash } = this.page.url;
    try {
      const redirect = { ...newSecrets(), hash, isSilent, work };
      const url = await this.provider.authorizationUrl(redirect, redirectUri(this.page));
      keepRedirect(this.page, redirect);
      this.page.go(url);
    } catch (thrown) {
      const problem = loginSentence(thrown, this.issuer);
      const isThere = before.kind === "ending" || before.kind === "ended";
      this.become(isThere ? { ...before, text: problem } : { kind: "out", problem });
    }
  }

  private take(tokens: Tokens): void {
    this.tokens = tokens;
    this.endsAt = this.now() + tokens.lifetimeMs;
    this.bearer.token = tokens.accessToken;
    this.become({ kind: "in", name: this.name });
    this.wait(tokens.lifetimeMs - Math.min(RENEWED_BEFORE_MS, tokens.lifetimeMs / 3), () => void this.renew(false));
  }

  private wait(delayMs: number, action: () => void): void {
    this.stopTimer?.();
    this.stopTimer = this.timer(action, Math.max(0, delayMs));
  }

  /** True when there is a new token. One renewal at a time, however many ask. */
  private renew(isReplacement: boolean): Promise<boolean> {
    this.renewal ??= this.renewOnce(isReplacement).finally(() => (this.renewal = null));
    return this.renewal;
  }

  private async renewOnce(isReplacement: boolean): Promise<boolean> {
    const refreshToken = this.tokens?.refreshToken ?? null;
    if (refreshToken === null) return this.runOut("The identity provider does not renew it.", false);
    try {
      const tokens = await this.provider.renew(refreshToken);
      if (this.tokens === null) return false;
      this.isReplacement = isReplacement;
      this.take(tokens);
      return true;
    } catch (thrown) {
      return this.runOut(loginSentence(thrown, this.issuer), !isRefusal(thrown));
    }
  }

  /** No new token: the old one is good for as long as it is. */
  private runOut(text: string, again: boolean): false {
    const leftMs = this.endsAt - this.now();
    if (this.tokens === null) return false;
    if (leftMs <= 0) {
      this.end(`Your login has ended. ${text}`);
      return false;
    }
    this.become({ kind: "ending", name: this.name, text: `Your login ends soon. ${text}` });
    if (again) this.wait(Math.min(RETRY_MS, leftMs), () => void this.renew(false));
    else this.wait(leftMs, () => this.end("Your login has ended."));
    return false;
  }

  /** The server does not take the token. Twice in a row is no matter of time. */
  private async replace(why: string): Promise<boolean> {
    if (this.tokens === null) return false;
    const isRenewed = !this.isReplacement && (await this.renew(true));
    if (!isRenewed && this.tokens !== null) this.end(`The server does not accept your login. ${messageOf(why)}`);
    return isRenewed;
  }

  private end(text: string): void {
    this.forget();
    this.become({ kind: "ended", name: this.name, text });
  }

  private forget(): void {
    this.stopTimer?.();
    this.tokens = null;
    this.isReplacement = false;
    this.bearer.token = "";
  }

  private get name(): string {
    return this.user?.name ?? "";
  }

  private become(state: LoginState): void {
    this.current = state;
    this.listeners.forEach((listener) => listener(state));
  }
}
