// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import * as oauth from "oauth4webapi";
import { expect, test } from "vitest";
import { Bearer } from "../../src/calls/bearer";
import { Login } from "../../src/login/login";
import type { Provider, Tokens } from "../../src/login/provider";
import type { LoginPage, Redirect } from "../../src/login/redirect";

const ISSUER = "https://login.example.org";
const HOUR_MS = 3_600_000;

/** A tab: what it keeps outlives the pages in it. */
class FakeTab {
  readonly kept = new Map<string, string>();
  readonly gone: string[] = [];
  address = "https://planner.example.org/#case=abc";

  page(): LoginPage {
    const tab = this;
    return {
      get url() {
        return new URL(tab.address);
      },
      storage: {
        getItem: (name) => this.kept.get(name) ?? null,
        setItem: (name, value) => void this.kept.set(name, value),
        removeItem: (name) => void this.kept.delete(name),
      },
      rename: (url) => (this.address = url),
      go: (url) => void this.gone.push(url),
    };
  }
}

/** A provider that gives what the test has put there. */
class FakeProvider implements Provider {
  answers: (Error | Tokens)[] = [];
  readonly asked: string[] = [];
  redirects: Redirect[] = [];
  canEndSessions = true;

  authorizationUrl(redirect: Redirect): Promise<string> {
    this.redirects.push(redirect);
    return this.isDown ? Promise.reject(new TypeError("fetch failed")) : Promise.resolve(`${ISSUER}/auth?state=${redirect.state}`);
  }
  isDown = false;

  async exchange(answer: URLSearchParams, redirect: Redirect) {
    this.asked.push(`code ${answer.get("code")}`);
    if (answer.get("state") !== redirect.state) throw new oauth.OperationProcessingError("unexpected state");
    return { ...this.next(), user: { name: "Dr. Ada", idToken: "id" } };
  }

  async renew(refreshToken: string): Promise<Tokens> {
    this.asked.push(`renew ${refreshToken}`);
    return this.next();
  }

  async endSessionUrl(): Promise<string | null> {
    return this.canEndSessions ? `${ISSUER}/end` : null;
  }

  private next(): Tokens {
    const answer = this.answers.shift();
    if (answer === undefined || answer instanceof Error) throw answer ?? new Error("nothing was to be asked");
    return answer;
  }
}

const tokens = (name: string, refreshToken: string | null = `refresh ${name}`): Tokens => ({ accessToken: name, refreshToken, lifetimeMs: HOUR_MS });

/** One page after the other in one tab. */
function visits() {
  const tab = new FakeTab();
  const provider = new FakeProvider();
  const timers: { action: () => void; delayMs: number }[] = [];
  let now = 0;
  const load = async () => {
    const bearer = new Bearer();
    const timer = (action: () => void, delayMs: number) => {
      const entry = { action, delayMs };
      timers.push(entry);
      return () => void timers.splice(timers.indexOf(entry), 1);
    };
    const login = new Login(provider, ISSUER, bearer, tab.page(), timer, () => now);
    await login.begin();
    return { login, bearer };
  };
  /** As the provider sends the user back, with its answer to the newest login. */
  const back = (query: Record<string, string> = {}) => {
    const { state } = provider.redirects[provider.redirects.length - 1];
    tab.address = `https://planner.example.org/?${new URLSearchParams({ code: "c", state, ...query })}`;
    return load();
  };
  const signedIn = async (first = tokens("one")) => {
    provider.answers.push(first);
    await load();
    return back();
  };
  const pass = async () => {
    const { action, delayMs } = timers.pop()!;
    now += delayMs;
    action();
    await new Promise((done) => setImmediate(done));
  };
  return { tab, provider, timers, load, back, signedIn, pass };
}

test("a user whom the provider knows is signed in without a prompt, at the same address", async () => {
  const { tab, provider, load, back } = visits();
  const first = await load();
  expect(first.login.state.kind).toBe("asking");
  expect(provider.redirects[0].isSilent).toBe(true);
  expect(tab.gone[0]).toContain(`${ISSUER}/auth`);
  provider.answers.push(tokens("one"));
  const { login, bearer } = await back();
  expect(login.state).toEqual({ kind: "in", name: "Dr. Ada" });
  expect(bearer.headers).toEqual({ authorization: "Bearer one" });
  expect(tab.address).toBe("https://planner.example.org/#case=abc");
});

test("no token lies in the tab's storage", async () => {
  const { tab, signedIn } = visits();
  await signedIn();
  expect(Array.from(tab.kept)).toEqual([]);
});

test("an unknown user sees the sign-in button, and then the provider's prompt", async () => {
  const { tab, provider, load, back } = visits();
  await load();
  const { login } = await back({ error: "login_required" });
  expect(provider.asked).toEqual(["code c"]);
  expect(login.state.kind).toBe("out");
  await login.signIn();
  expect(provider.redirects[1].isSilent).toBe(false);
  expect(tab.gone).toHaveLength(2);
});

test("every login has secrets of its own", async () => {
  const { provider, load } = visits();
  await load();
  await load();
  const [first, second] = provider.redirects;
  for (const name of ["state", "nonce", "verifier"] as const) {
    expect(first[name].length).toBeGreaterThanOrEqual(43);
    expect(second[name]).not.toBe(first[name]);
  }
});

test.each([
  ["another state", { state: "forged" }, "does not belong to this login"],
  ["no state", { state: "" }, "does not belong to this login"],
])("an answer of %s lets nobody in", async (_, query, text) => {
  const { provider, load, back } = visits();
  provider.answers.push(tokens("one"));
  await load();
  const { login, bearer } = await back(query);
  expect(login.state).toMatchObject({ kind: "out", problem: expect.stringContaining(text) });
  expect(bearer.token).toBe("");
});

test("an answer counts once, and only in the tab that asked", async () => {
  const { provider, tab, signedIn, load } = visits();
  await signedIn();
  provider.answers.push(tokens("two"));
  tab.address = "https://planner.example.org/?code=c&state=s";
  const { login, bearer } = await load();
  expect(login.state).toMatchObject({ kind: "out", problem: expect.stringContaining("No login was started") });
  expect(bearer.token).toBe("");
  expect(tab.address).toBe("https://planner.example.org/");
});

test("a provider that is down is a sentence with another try", async () => {
  const { tab, provider, load } = visits();
  provider.isDown = true;
  const { login } = await load();
  expect(login.state).toEqual({ kind: "out", problem: "The identity provider (login.example.org) does not answer. Try again in a moment." });
  expect(tab.gone).toEqual([]);
  provider.isDown = false;
  await login.signIn();
  expect(tab.gone).toHaveLength(1);
});

test("a token is renewed before it ends, again and again", async () => {
  const { provider, timers, signedIn, pass } = visits();
  const { login, bearer } = await signedIn();
  provider.answers.push(tokens("two"), tokens("three"));
  const heard: string[] = [];
  bearer.watch((token) => heard.push(token));
  expect(timers[0].delayMs).toBe(HOUR_MS - 60_000);
  await pass();
  await pass();
  expect(heard).toEqual(["two", "three"]);
  expect(provider.asked).toEqual(["code c", "renew refresh one", "renew refresh two"]);
  expect(login.state.kind).toBe("in");
});

test("a provider that is away for a moment is asked again", async () => {
  const { provider, signedIn, pass } = visits();
  const { login, bearer } = await signedIn();
  provider.answers.push(new TypeError("fetch failed"), tokens("two"));
  await pass();
  expect(login.state.kind).toBe("ending");
  expect(bearer.token).toBe("one");
  await pass();
  expect(login.state.kind).toBe("in");
  expect(bearer.token).toBe("two");
});

test("a provider that stays away ends the login with the token", async () => {
  const { provider, signedIn, pass } = visits();
  const { login, bearer } = await signedIn();
  provider.answers.push(...Array.from({ length: 20 }, () => new TypeError("fetch failed")));
  for (let i = 0; i < 20 && login.state.kind !== "ended"; ++i) await pass();
  expect(login.state).toMatchObject({ kind: "ended", text: expect.stringMatching(/^Your login has ended\. .* does not answer/) });
  expect(bearer.token).toBe("");
});

test("without a refresh token the user is notified before the end, and at it", async () => {
  const { signedIn, pass } = visits();
  const { login, bearer } = await signedIn(tokens("one", null));
  await pass();
  expect(login.state.kind).toBe("ending");
  expect(bearer.token).toBe("one");
  await pass();
  expect(login.state.kind).toBe("ended");
  expect(bearer.token).toBe("");
});

test("work is there again after another login", async () => {
  const { provider, signedIn, back } = visits();
  const { login } = await signedIn();
  await login.signIn({ poses: [1, 2, 3] });
  provider.answers.push(tokens("two"));
  const again = await back();
  expect(again.login.work).toEqual({ poses: [1, 2, 3] });
});

test("work is kept over a login that fails", async () => {
  const { provider, signedIn, back } = visits();
  const { login } = await signedIn();
  await login.signIn({ poses: [1] });
  const failed = await back({ state: "forged" });
  await failed.login.signIn();
  provider.answers.push(tokens("two"));
  expect((await back()).login.work).toEqual({ poses: [1] });
});

test.each([[true, `${ISSUER}/end`], [false, "https://planner.example.org/"]])("a user who signs out is not signed in again without a prompt (%s)", async (canEnd, url) => {
  const { tab, provider, timers, signedIn, load } = visits();
  provider.canEndSessions = canEnd;
  const { login, bearer } = await signedIn();
  await login.signOut();
  expect(bearer.token).toBe("");
  expect(timers).toEqual([]);
  expect(tab.gone.at(-1)).toBe(url);
  const asked = tab.gone.length;
  const next = await load();
  expect(next.login.state).toEqual({ kind: "out", problem: "" });
  expect(tab.gone).toHaveLength(asked);
});

test("a token that the server refuses is replaced once, for all who ask", async () => {
  const { provider, signedIn } = visits();
  const { bearer } = await signedIn();
  provider.answers.push(tokens("two"));
  expect(await Promise.all([bearer.replace("one", "the token has a fault"), bearer.replace("one", "the token has a fault"), bearer.replace("one", "the token has a fault")])).toEqual([true, true, true]);
  expect(await bearer.replace("one", "the token has a fault")).toBe(true);
  expect(bearer.token).toBe("two");
  expect(provider.asked).toEqual(["code c", "renew refresh one"]);
});

test("a server that refuses every token ends the login", async () => {
  const { provider, signedIn } = visits();
  const { login, bearer } = await signedIn();
  provider.answers.push(tokens("two"), tokens("three"));
  await bearer.replace("one", "the token has a fault");
  expect(await bearer.replace("two", "the token's issuer is \"a\"; log in there")).toBe(false);
  expect(login.state).toMatchObject({ kind: "ended", text: 'The server does not accept your login. The token\'s issuer is "a"; log in there.' });
  expect(provider.asked).toEqual(["code c", "renew refresh one"]);
});

test("a server that refuses a token which cannot be renewed says why", async () => {
  const { signedIn } = visits();
  const { login, bearer } = await signedIn(tokens("one", null));
  expect(await bearer.replace("one", "the token's audience is \"a\"")).toBe(false);
  expect(login.state).toMatchObject({ kind: "ended", text: 'The server does not accept your login. The token\'s audience is "a".' });
});
