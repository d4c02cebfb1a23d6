// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { messageOf } from "../calls/call_error";
import { type ContactChoice, canBeSealed, contactChoiceOf } from "../case/contact_choice";
import type { Workbench } from "../workbench/workbench";
import { el, select } from "./dom";
import { pagePart } from "./page_part";

const ON = { value: "on", label: "Lips part, tissue slides" } as const;
const SEALED = { value: "sealed", label: "Lips sealed, tissue slides" } as const;
const OFF = { value: "off", label: "Tissue sticks, lips are one piece" } as const;

/** Whether tissue touches or sticks, and how it touches now; nothing for a case that has no contact. */
export function contactPart(bench: Workbench, choose: (choice: ContactChoice) => Promise<void>): HTMLElement {
  const chosen = contactChoiceOf(bench.file);
  if (chosen === "on" && !bench.touches) return el("span", { attributes: { hidden: "" } });
  const choices: { value: ContactChoice; label: string }[] = canBeSealed(bench.file.parted ?? bench.file) ? [ON, SEALED, OFF] : [ON, OFF];
  const field = select("Contact", choices, (value) => {
    if (value !== chosen) choose(value).catch((thrown) => (bench.notice.value = messageOf(thrown)));
  });
  field.set(choices, choices.findIndex(({ value }) => value === chosen));
  const touch = el("div");
  if (chosen !== "off") {
    pagePart(() => import("./touch_part"))
      .then(({ touchPart }) => touch.replaceChildren(...touchPart(bench)))
      .catch((thrown) => (bench.notice.value = messageOf(thrown)));
  }
  return el("div", {}, [field.element, touch]);
}
