// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { messageOf } from "../calls/call_error";
import type { ContactSummary } from "../generated/tissueform/v1/deform_service_pb";
import { formatNumber } from "../planning/numbers";
import type { Workbench } from "../workbench/workbench";
import { el, select, throttleToFrame } from "./dom";

const CHOICES = [
  { value: false, label: "Lips part, tissue slides" },
  { value: true, label: "Tissue sticks, lips are one piece" },
];

/** Whether tissue touches or sticks, and how it touches now; nothing for a case that has no contact. */
export function contactPart(bench: Workbench, choose: (sticks: boolean) => Promise<void>): HTMLElement {
  const sticks = bench.file.parted !== null;
  if (!sticks && !bench.touches) return el("span", { attributes: { hidden: "" } });
  const field = select("Contact", CHOICES, (value) => {
    if (value !== sticks) choose(value).catch((thrown) => (bench.notice.value = messageOf(thrown)));
  });
  field.set(CHOICES, sticks ? 1 : 0);
  const told = el("p", { class: "quiet" });
  const show = () => {
    const text = describeContact(bench.picture.value?.summary?.contact);
    if (told.textContent !== text) told.textContent = text;
  };
  bench.picture.watch(throttleToFrame(show));
  return el("div", {}, [field.element, told]);
}

/** How tissue touches, in a sentence; "" where it is not known. */
export function describeContact(contact: ContactSummary | undefined): string {
  if (contact === undefined) return "";
  const force = contact.maxForceN === undefined ? "" : `, with ${formatNumber(contact.maxForceN, 3)} N at most at one`;
  const places = `Tissue presses at ${contact.pressingRowCount} of ${contact.rowCount} places${force}.`;
  return contact.pressingRowCount === 0 ? `Tissue presses nowhere: ${contact.rowCount} places may lift off.` : places;
}
