// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { afterEach, expect, test, vi } from "vitest";
import { fetchLoginConfig, readLoginConfig } from "../../src/login/login_config";

afterEach(() => vi.unstubAllGlobals());

const answer = (body: string, status = 200) => vi.stubGlobal("fetch", () => Promise.resolve(new Response(body, { status })));

test("a gateway without a provider has no login", async () => {
  answer("{}");
  expect(await fetchLoginConfig("")).toBeNull();
});

test("what serves the page in a gateway's place has no login", async () => {
  answer("<html>", 404);
  expect(await fetchLoginConfig("")).toBeNull();
});

test("a provider is taken as the gateway names it", () => {
  const oidc = { issuer: "https://a", client_id: "planner", audience: "x", scope: "openid" };
  expect(readLoginConfig({ oidc })).toEqual({ issuer: "https://a", clientId: "planner", audience: "x", scope: "openid" });
});

test.each(["<html>", "[]", "3", "null", '{"oidc":3}', '{"oidc":{}}', '{"oidc":{"issuer":"https://a","client_id":4}}'])("%s is no configuration, and nobody is let in by it", async (body) => {
  answer(body);
  await expect(fetchLoginConfig("")).rejects.toThrow("gateway's configuration");
});

test("a gateway that does not answer is a sentence", async () => {
  vi.stubGlobal("fetch", () => Promise.reject(new TypeError("failed")));
  await expect(fetchLoginConfig("")).rejects.toThrow("does not answer");
  answer("", 503);
  await expect(fetchLoginConfig("")).rejects.toThrow("503");
});
