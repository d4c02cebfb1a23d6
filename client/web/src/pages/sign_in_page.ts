// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Login } from "../login/login";
import { button, el, whileBusy } from "../panels/dom";

/** The page for a user who is not signed in; `problem`: why, "" where nothing went wrong. */
export function signInPage(login: Login, problem: string): HTMLElement {
  const start = button("Sign in", () => void whileBusy(start, () => login.signIn(), () => {}), { attributes: { type: "submit" } });
  return el("main", { class: "start" }, [
    el("div", { class: "sheet" }, [
      el("h1", { text: "Tissueform" }),
      el("p", { class: "lead", text: "Move the bone, see the face follow." }),
      el("p", { class: "problem", text: problem, attributes: { role: "alert" } }),
      el("div", { class: "buttons" }, [start]),
      el("p", { class: "quiet", text: "Not a medical device." }),
    ]),
  ]);
}
