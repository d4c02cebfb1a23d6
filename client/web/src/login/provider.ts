// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import * as oauth from "oauth4webapi";
import type { LoginConfig } from "./login_config";
import type { Redirect } from "./redirect";

export interface Tokens {
  accessToken: string;
  /** Null where the provider gives none: the login ends with the token. */
  refreshToken: string | null;
  lifetimeMs: number;
}

export interface User {
  /** As the provider calls them. */
  name: string;
  idToken: string;
}

/** What a login needs of an identity provider; tests have their own. All reject as `loginSentence` describes. */
export interface Provider {
  /** Where the user is asked; `isSilent`: is not asked, and the answer is an error where that would be needed. */
  authorizationUrl(redirect: Redirect, redirectUri: string): Promise<string>;
  /** `answer`: the query with which the user came back. */
  exchange(answer: URLSearchParams, redirect: Redirect, redirectUri: string): Promise<Tokens & { user: User }>;
  renew(refreshToken: string): Promise<Tokens>;
  /** Where the user is signed out at the provider, too; null where it has no such place. */
  endSessionUrl(user: User, redirectUri: string): Promise<string | null>;
}

/** What only the page itself may know of a login that begins. */
export function newSecrets(): Pick<Redirect, "state" | "nonce" | "verifier"> {
  return { state: oauth.generateRandomState(), nonce: oauth.generateRandomNonce(), verifier: oauth.generateRandomCodeVerifier() };
}

const DEADLINE_MS = 10_000;
/** Of a token whose lifetime the provider does not report. */
const DEFAULT_LIFETIME_S = 300;

/** OpenID Connect's code flow with PKCE, as a public client. What the provider says of itself is asked for once. */
export class OidcProvider implements Provider {
  private readonly client: oauth.Client;
  private readonly issuer: URL;
  private server: Promise<oauth.AuthorizationServer> | null = null;

  constructor(private readonly config: LoginConfig) {
    this.client = { client_id: config.clientId };
    this.issuer = new URL(config.issuer);
  }

  async authorizationUrl(redirect: Redirect, redirectUri: string): Promise<string> {
    const server = await this.discover();
    const url = new URL(server.authorization_endpoint ?? fail("the identity provider has no login address"));
    const parameters = {
      client_id: this.config.clientId,
      redirect_uri: redirectUri,
      response_type: "code",
      scope: this.config.scope,
      state: redirect.state,
      nonce: redirect.nonce,
      code_challenge: await oauth.calculatePKCECodeChallenge(redirect.verifier),
      code_challenge_method: "S256",
      ...(this.config.audience === "" ? {} : { audience: this.config.audience }),
      ...this.resource,
      ...(redirect.isSilent ? { prompt: "none" } : {}),
    };
    Object.entries(parameters).forEach(([name, value]) => url.searchParams.set(name, value));
    return url.href;
  }

  async exchange(answer: URLSearchParams, redirect: Redirect, redirectUri: string): Promise<Tokens & { user: User }> {
    const server = await this.discover();
    const valid = oauth.validateAuthResponse(server, this.client, answer, redirect.state);
    const options = { ...this.options, additionalParameters: this.resource };
    const response = await oauth.authorizationCodeGrantRequest(server, this.client, oauth.None(), valid, redirectUri, redirect.verifier, options);
    const tokens = await oauth.processAuthorizationCodeResponse(server, this.client, response, { expectedNonce: redirect.nonce, requireIdToken: true });
    return { ...tokensOf(tokens), user: userOf(tokens) };
  }

  async renew(refreshToken: string): Promise<Tokens> {
    const server = await this.discover();
    const options = { ...this.options, additionalParameters: this.resource };
    const response = await oauth.refreshTokenGrantRequest(server, this.client, oauth.None(), refreshToken, options);
    const tokens = tokensOf(await oauth.processRefreshTokenResponse(server, this.client, response));
    return { ...tokens, refreshToken: tokens.refreshToken ?? refreshToken };
  }

  async endSessionUrl(user: User, redirectUri: string): Promise<string | null> {
    const { end_session_endpoint: endpoint } = await this.discover();
    if (typeof endpoint !== "string") return null;
    const url = new URL(endpoint);
    const parameters = { client_id: this.config.clientId, id_token_hint: user.idToken, post_logout_redirect_uri: redirectUri };
    Object.entries(parameters).forEach(([name, value]) => url.searchParams.set(name, value));
    return url.href;
  }

  // Providers that know RFC 8707 call the audience a resource, which must be a URI.
  private get resource(): Record<string, string> {
    return /^[a-z][a-z0-9+.-]*:/i.test(this.config.audience) ? { resource: this.config.audience } : {};
  }

  // Without TLS the gateway names providers on loopback only.
  private get options() {
    return { [oauth.allowInsecureRequests]: this.issuer.protocol === "http:", signal: () => AbortSignal.timeout(DEADLINE_MS) };
  }

  private discover(): Promise<oauth.AuthorizationServer> {
    this.server ??= oauth
      .discoveryRequest(this.issuer, this.options)
      .then((response) => oauth.processDiscoveryResponse(this.issuer, response))
      .catch((thrown) => {
        this.server = null;
        throw thrown;
      });
    return this.server;
  }
}

function fail(text: string): never {
  throw new Error(text);
}

function tokensOf(response: oauth.TokenEndpointResponse): Tokens {
  return {
    accessToken: response.access_token,
    refreshToken: response.refresh_token ?? null,
    lifetimeMs: 1000 * (response.expires_in ?? DEFAULT_LIFETIME_S),
  };
}

function userOf(response: oauth.TokenEndpointResponse): User {
  const claims = oauth.getValidatedIdTokenClaims(response);
  const names = [claims?.name, claims?.preferred_username, claims?.email, claims?.sub];
  const name = names.find((value): value is string => typeof value === "string" && value !== "") ?? "";
  return { name, idToken: response.id_token ?? "" };
}

/** The provider could not sign the user in without asking them something. */
export function needsUser(thrown: unknown): boolean {
  const asking = ["login_required", "interaction_required", "consent_required", "account_selection_required"];
  return thrown instanceof oauth.AuthorizationResponseError && asking.includes(thrown.error);
}

/** The provider has refused, so that asking once more the same way is no use. */
export function isRefusal(thrown: unknown): boolean {
  return thrown instanceof oauth.ResponseBodyError && thrown.status < 500;
}

/** What oauth4webapi says of an answer that it does not take. */
interface Cause {
  expected?: unknown;
  body?: { issuer?: unknown };
  claims?: Record<string, unknown>;
  claim?: string;
  attribute?: string;
  now?: number;
}

/** Which issuer or time in the provider's answer is another one than expected; null where it is something else. */
function differenceIn({ code, cause }: oauth.OperationProcessingError, issuer: string): string | null {
  const { expected, body, claims, claim = "", attribute, now = 0 } = (cause ?? {}) as Cause;
  if (code === oauth.JSON_ATTRIBUTE_COMPARISON && attribute === "issuer") return otherIssuer(body?.issuer, issuer);
  if (code === oauth.JWT_CLAIM_COMPARISON && claim === "iss") return otherIssuer(claims?.iss, String(expected ?? issuer));
  if (code !== oauth.JWT_TIMESTAMP_CHECK) return null;
  const seconds = Math.round(Math.abs(Number(claims?.[claim]) - now));
  const when = claim === "exp" ? `ended ${seconds} s ago` : `becomes valid in ${seconds} s`;
  return `By this computer's clock the login ${when}. Set the clock of this computer, or of the identity provider, and sign in again.`;
}

function otherIssuer(found: unknown, expected: string): string {
  const advice = String(found).includes("{")
    ? "A name with {...} is for every tenant: set the gateway's --oidc-issuer to your own tenant."
    : "Correct the gateway's --oidc-issuer.";
  return `The identity provider's issuer is ${bounded(found)}, and this page expects ${bounded(expected)}. ${advice}`;
}

/** A text from another party: at most 200 letters, and only printable ASCII. */
function bounded(text: unknown): string {
  return String(text).slice(0, 200).replace(/[^\x20-\x7e]/g, "?");
}

/** Why a login failed, as a sentence. Of what the provider sent it holds its own word for the error, its issuer and times, all bounded. */
export function loginSentence(thrown: unknown, issuer: string): string {
  const host = new URL(issuer).host;
  if (globalThis.crypto?.subtle === undefined) return "This page was not opened with https, which a login requires.";
  if (thrown instanceof oauth.AuthorizationResponseError || thrown instanceof oauth.ResponseBodyError) {
    const word = /^[a-z_]{1,40}$/.test(thrown.error) ? thrown.error : "for an unknown reason";
    return `The identity provider (${host}) refused the login: ${word}.`;
  }
  const difference = thrown instanceof oauth.OperationProcessingError ? differenceIn(thrown, issuer) : null;
  if (difference !== null) return difference;
  if (thrown instanceof oauth.OperationProcessingError || thrown instanceof oauth.UnsupportedOperationError) {
    return `The answer of the identity provider (${host}) does not belong to this login.`;
  }
  return `The identity provider (${host}) does not answer. Try again in a moment.`;
}
