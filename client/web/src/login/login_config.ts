// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

/** Where this page's users log in: the gateway's configuration (docs/gateway.md). */
export interface LoginConfig {
  issuer: string;
  clientId: string;
  /** The requested audience of tokens; "": the provider's choice. */
  audience: string;
  scope: string;
}

const DEADLINE_MS = 10_000;

/** Null where there is no login. Rejects, with a sentence, where the gateway does not say. */
export async function fetchLoginConfig(base: string): Promise<LoginConfig | null> {
  let response: Response;
  try {
    response = await fetch(`${base}/config.json`, { cache: "no-store", signal: AbortSignal.timeout(DEADLINE_MS) });
  } catch {
    throw new Error("the gateway does not answer: try again in a moment");
  }
  // A server that serves the page in the gateway's place does not know about logins.
  if (response.status === 404) return null;
  if (!response.ok) throw new Error(`the gateway does not report how to log in (${response.status}): try again in a moment`);
  return readLoginConfig(await response.json().catch(() => undefined));
}

/** Throws, with a sentence, where `json` is no configuration. */
export function readLoginConfig(json: unknown): LoginConfig | null {
  const oidc = isObject(json) ? json.oidc : json;
  if (isObject(json) && oidc === undefined) return null;
  if (!isObject(oidc)) throw new Error("the gateway's configuration cannot be read");
  const { issuer, client_id: clientId, audience = "", scope = "openid" } = oidc;
  if (typeof issuer !== "string" || typeof clientId !== "string" || typeof audience !== "string" || typeof scope !== "string") {
    throw new Error("the gateway's configuration names no identity provider");
  }
  return { issuer, clientId, audience, scope };
}

function isObject(value: unknown): value is Record<string, unknown> {
  return typeof value === "object" && value !== null && !Array.isArray(value);
}
