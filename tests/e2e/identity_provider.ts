// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { generateKeyPairSync } from "node:crypto";
import { type Server, createServer } from "node:http";
import type { AddressInfo } from "node:net";
import Provider, { type Configuration } from "oidc-provider";
import type { Page } from "playwright-core";

/** The audience of the tokens: what the server is started with. */
export const AUDIENCE = "https://tissueform.example.org";

/** An identity provider on loopback, by a program of another project: its users sign in with any password. */
export class IdentityProvider {
  /** How long a token is good. */
  tokenSeconds = 3600;
  /** Tokens that were given for refresh tokens. */
  renewed = 0;
  private server: Server | null = null;
  private handler: (request: never, response: never) => void = () => {};
  private port = 0;
  private readonly key = generateKeyPairSync("ec", { namedCurve: "P-256" }).privateKey.export({ format: "jwk" });

  static async start(): Promise<IdentityProvider> {
    const provider = new IdentityProvider();
    await provider.listen();
    // Servers ask for keys at their start, when the address of the pages is not yet known.
    provider.admit(provider.issuer);
    return provider;
  }

  get issuer(): string {
    return `http://127.0.0.1:${this.port}`;
  }

  get gatewayOptions(): string[] {
    return ["--oidc-issuer", this.issuer, "--oidc-client-id", "planner", "--oidc-audience", AUDIENCE];
  }

  get serverOptions(): string[] {
    return ["--token-issuer", this.issuer, "--token-audience", AUDIENCE, "--token-jwks-url", `${this.issuer}/jwks`];
  }

  /** Lets pages of `url` and the command log in. */
  admit(url: string): void {
    const provider = new Provider(this.issuer, this.configuration(`${url}/`));
    provider.on("grant.success", ({ oidc }) => {
      if (oidc.params?.grant_type === "refresh_token") this.renewed += 1;
    });
    this.handler = provider.callback() as never;
  }

  /** At the same address as before, with all that it knew. */
  async listen(): Promise<void> {
    const server = createServer((request, response) => this.handler(request as never, response as never));
    await new Promise<void>((accept) => server.listen(this.port, "127.0.0.1", accept));
    this.port = (server.address() as AddressInfo).port;
    this.server = server;
  }

  async stop(): Promise<void> {
    const { server } = this;
    this.server = null;
    if (server === null) return;
    const closed = new Promise((accept) => server.close(accept));
    server.closeAllConnections();
    await closed;
  }

  private configuration(redirectUri: string): Configuration {
    const device = "urn:ietf:params:oauth:grant-type:device_code";
    const key = { ...this.key, kid: "today", alg: "ES256", use: "sig" };
    const resource = () => ({ scope: "", audience: AUDIENCE, accessTokenTTL: this.tokenSeconds, accessTokenFormat: "jwt" as const, jwt: { sign: { alg: "ES256" as const } } });
    const common = { token_endpoint_auth_method: "none" as const, id_token_signed_response_alg: "ES256" as const };
    return {
      jwks: { keys: [key] },
      clients: [
        { ...common, client_id: "planner", redirect_uris: [redirectUri], post_logout_redirect_uris: [redirectUri], grant_types: ["authorization_code", "refresh_token"] },
        { ...common, client_id: "command", redirect_uris: [], response_types: [], grant_types: [device, "refresh_token"] },
      ],
      features: {
        deviceFlow: { enabled: true },
        resourceIndicators: { enabled: true, defaultResource: () => AUDIENCE, getResourceServerInfo: resource, useGrantedResource: () => true },
      },
      clientBasedCORS: () => true,
      cookies: { keys: ["a key of a test"] },
      findAccount: (_, id) => ({ accountId: id, claims: () => ({ sub: id, name: `Dr. ${id}` }) }),
      claims: { openid: ["sub"], profile: ["name"] },
      conformIdTokenClaims: false,
      extraTokenClaims: () => ({ tissueform_roles: ["publisher"] }),
      issueRefreshToken: () => true,
      // A house of its own does not ask its people whether it may know them.
      loadExistingGrant: async ({ oidc }) => {
        const grant = new oidc.provider.Grant({ clientId: oidc.client?.clientId, accountId: oidc.session?.accountId });
        grant.addOIDCScope("openid profile offline_access");
        grant.addResourceScope(AUDIENCE, "");
        await grant.save();
        return grant;
      },
    };
  }
}

/** Fills in the provider's page. */
export async function enterName(page: Page, name: string): Promise<void> {
  await page.locator("input[name=login]").fill(name);
  await page.locator("input[name=password]").fill("any");
  await page.locator("button[type=submit]").click();
}
