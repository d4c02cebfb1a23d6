// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { afterEach, expect, test, vi } from "vitest";
import { OidcProvider, loginSentence, newSecrets } from "../../src/login/provider";

const ISSUER = "https://login.example.org/clinic";
const REDIRECT_URI = "https://planner.example.org/";
const CONFIG = { issuer: ISSUER, clientId: "planner", audience: "", scope: "openid" };
const seconds = () => Math.floor(Date.now() / 1000);

afterEach(() => vi.unstubAllGlobals());

const base64 = (json: unknown) => Buffer.from(JSON.stringify(json)).toString("base64url");

/** A provider that names itself `issuer`, and gives ID tokens with these claims. */
function serve({ issuer = ISSUER, claims = {} }: { issuer?: string; claims?: Record<string, unknown> }): void {
  const discovery = { issuer, authorization_endpoint: `${ISSUER}/auth`, token_endpoint: `${ISSUER}/token` };
  const all = { iss: ISSUER, aud: "planner", sub: "ada", iat: seconds(), exp: seconds() + 300, ...claims };
  const idToken = `${base64({ alg: "RS256" })}.${base64(all)}.${base64("signature")}`;
  const tokens = { access_token: "access", token_type: "Bearer", id_token: idToken, expires_in: 300 };
  const headers = { "content-type": "application/json" };
  vi.stubGlobal("fetch", async (url: string) => new Response(JSON.stringify(String(url).includes(".well-known") ? discovery : tokens), { headers }));
}

/** What the page says of a login there; "" where it succeeds. */
async function said(nonceOf: (nonce: string) => Record<string, unknown> = (nonce) => ({ nonce }), served: Parameters<typeof serve>[0] = {}): Promise<string> {
  const redirect = { ...newSecrets(), hash: "", isSilent: false, work: null };
  serve({ ...served, claims: { ...nonceOf(redirect.nonce), ...served.claims } });
  try {
    const provider = new OidcProvider(CONFIG);
    await provider.exchange(new URLSearchParams({ code: "c", state: redirect.state }), redirect, REDIRECT_URI);
    return "";
  } catch (thrown) {
    return loginSentence(thrown, ISSUER);
  }
}

test("a login with nothing wrong in it has no sentence", async () => {
  expect(await said()).toBe("");
});

test("a provider of another name is named, and so is the one that is expected", async () => {
  const sentence = await said(undefined, { issuer: "https://other.example.org/" });
  expect(sentence).toContain("issuer is https://other.example.org/, and this page expects https://login.example.org/clinic.");
  expect(sentence).toContain("--oidc-issuer");
});

test("a provider for all tenants is distinguished from another provider", async () => {
  const sentence = await said(undefined, { issuer: "https://login.example.org/{tenantid}/v2.0" });
  expect(sentence).toContain("{tenantid}");
  expect(sentence).toContain("to your own tenant");
});

test("an ID token of another issuer names both", async () => {
  const sentence = await said(undefined, { claims: { iss: "https://sts.example.net/1/" } });
  expect(sentence).toContain("issuer is https://sts.example.net/1/, and this page expects https://login.example.org/clinic.");
});

test.each([
  ["exp", -300, /ended 30\d s ago/],
  ["nbf", 300, /becomes valid in (300|299) s/],
])("a clock that is off by 5 minutes is a sentence about clocks (%s)", async (claim, offset, pattern) => {
  const sentence = await said(undefined, { claims: { [claim]: seconds() + offset } });
  expect(sentence).toMatch(pattern);
  expect(sentence).toContain("clock of this computer");
});

test("text from a provider is bounded and printable before it is shown", async () => {
  const sentence = await said(undefined, { claims: { iss: `https://evil.example/\u202e\n${"a".repeat(5000)}` } });
  expect(sentence).toContain("https://evil.example/??aaa");
  expect(sentence.length).toBeLessThan(500);
});

test("an answer that is wrong in another way belongs to no login", async () => {
  expect(await said(() => ({ nonce: "another" }))).toContain("does not belong to this login");
});
