// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Login } from "../login/login";
import { button, el, whileBusy } from "./dom";

/** Who is signed in, with a way out. */
export function accountBox(login: Login): HTMLElement {
  const name = el("span", { class: "user" });
  const out = button("Sign out", () => void whileBusy(out, () => login.signOut(), () => {}));
  login.watch((state) => {
    if ("name" in state) name.textContent = state.name;
  });
  return el("span", { class: "account", attributes: { role: "group", "aria-label": "Login" } }, [name, out]);
}

/** Lies over every page once the login ends, with a way to go on: `work` is what is under the user's hands then. */
export function loginBanner(login: Login, work: () => unknown): HTMLElement {
  const text = el("span");
  const again = button("Sign in again", () => void whileBusy(again, () => login.signIn(work()), () => {}));
  const banner = el("div", { class: "login-banner", attributes: { role: "alert" } }, [text, again]);
  login.watch((state) => {
    banner.hidden = state.kind !== "ending" && state.kind !== "ended";
    text.textContent = state.kind === "ending" || state.kind === "ended" ? state.text : "";
  });
  return banner;
}
