// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { el, newId } from "../panels/dom";
import { type Unit, formatNumber, parseNumber } from "../planning/numbers";

/** One step of a new plan: what the side of the page shows while it is the one. */
export interface Step {
  readonly title: string;
  readonly element: HTMLElement;
  /** Whether it needs a CT, and shows slices and bone. */
  readonly needsCt: boolean;
  /** The draft has changed. */
  update(): void;
}

/** A number with its label: shows `set`, and reports what a user typed. A text that is not a number is marked and not reported. */
export function numberField(label: string, unit: Unit, onNumber: (value: number) => void, decimals = 1): { element: HTMLElement; set(value: number): void } {
  const id = newId("number");
  const input = el("input", { id, attributes: { type: "text", inputmode: "decimal", autocomplete: "off" } });
  let shown = 0;
  input.addEventListener("change", () => {
    const value = parseNumber(input.value, unit);
    input.setAttribute("aria-invalid", String(value === null));
    if (value !== null && value !== shown) onNumber(value);
  });
  return {
    element: el("div", { class: "number" }, [el("label", { text: label, attributes: { for: id } }), input, el("span", { class: "unit", text: unit })]),
    set(value) {
      shown = value;
      if (document.activeElement === input && input.getAttribute("aria-invalid") === "true") return;
      input.value = formatNumber(value, decimals);
      input.setAttribute("aria-invalid", "false");
    },
  };
}

/** A sentence that screen readers hear when it appears. */
export function problemBox(): { element: HTMLElement; show(text: string): void } {
  const element = el("p", { class: "problem", attributes: { role: "alert" } });
  element.hidden = true;
  return {
    element,
    show(text) {
      element.textContent = text;
      element.hidden = text === "";
    },
  };
}
