// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { messageOf } from "../calls/call_error";
import type { Workbench } from "../workbench/workbench";
import { collapsible, el } from "./dom";
import { pagePart } from "./page_part";

/** Landmarks cannot be marked well on so small a picture. */
const PHONE = "(max-width: 640px)";

/** The patient's own skin over the prediction. All of it but this heading is fetched when it is opened. */
export function photographPanel(bench: Workbench): HTMLElement {
  const body = el("div");
  let isLoaded = false;
  const load = async () => {
    const { photographPart } = await pagePart(() => import("./photograph_part"));
    body.replaceChildren(photographPart(bench));
  };
  return collapsible("Photograph", [body], (isOpen) => {
    if (!isOpen || isLoaded) return;
    if (matchMedia(PHONE).matches) {
      body.replaceChildren(el("p", { class: "quiet", text: "Register a photograph on a larger screen. On a phone, open a moving file that holds it." }));
      return;
    }
    isLoaded = true;
    load().catch((thrown) => {
      isLoaded = false;
      bench.notice.value = messageOf(thrown);
    });
  });
}
