// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

/** What the page keeps while its user is at the identity provider: in the tab's storage, until the page is back. No token. */
export interface Redirect {
  state: string;
  nonce: string;
  /** PKCE's, of which the provider has the digest. */
  verifier: string;
  /** What stood behind the page's #. */
  hash: string;
  /** The provider must not ask the user anything. */
  isSilent: boolean;
  /** What the user had under their hands; the page's own, null where nothing was. */
  work: unknown;
}

const REDIRECT_KEY = "tissueform-login";
const SIGNED_OUT_KEY = "tissueform-signed-out";

/** The page as far as a login needs it; tests have their own. */
export interface LoginPage {
  /** With query and fragment. */
  readonly url: URL;
  readonly storage: Pick<Storage, "getItem" | "setItem" | "removeItem">;
  /** Shows another address without loading it; the one before is not in the history. */
  rename(url: string): void;
  /** Leaves the page. */
  go(url: string): void;
}

export const browserPage: LoginPage = {
  get url() {
    return new URL(location.href);
  },
  get storage() {
    return sessionStorage;
  },
  rename: (url) => history.replaceState(null, "", url),
  go: (url) => location.assign(url),
};

/** Where the provider sends the user back to: the page itself. */
export function redirectUri({ url }: LoginPage): string {
  return url.origin + url.pathname;
}

export function keepRedirect(page: LoginPage, redirect: Redirect): void {
  page.storage.setItem(REDIRECT_KEY, JSON.stringify(redirect));
}

/** Once: null where this tab has begun no login, or what it kept cannot be read. */
export function takeRedirect(page: LoginPage): Redirect | null {
  const text = page.storage.getItem(REDIRECT_KEY);
  page.storage.removeItem(REDIRECT_KEY);
  try {
    const redirect = JSON.parse(text ?? "null") as Partial<Redirect> | null;
    const texts = [redirect?.state, redirect?.nonce, redirect?.verifier, redirect?.hash];
    return texts.every((value) => typeof value === "string") ? (redirect as Redirect) : null;
  } catch {
    return null;
  }
}

/** The user has signed out in this tab, and is not to be signed in again unasked. */
export function markSignedOut(page: LoginPage, isSignedOut: boolean): void {
  if (isSignedOut) page.storage.setItem(SIGNED_OUT_KEY, "1");
  else page.storage.removeItem(SIGNED_OUT_KEY);
}

export function isSignedOut(page: LoginPage): boolean {
  return page.storage.getItem(SIGNED_OUT_KEY) !== null;
}

/**
 * What the provider has answered, taken out of the page's address, which then is what it was before the login; null where this
 * is no answer.
 */
export function takeAnswer(page: LoginPage, hash: string): URLSearchParams | null {
  const { searchParams } = page.url;
  if (!["code", "error", "state"].some((name) => searchParams.has(name))) return null;
  page.rename(redirectUri(page) + hash);
  return searchParams;
}
