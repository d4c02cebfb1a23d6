// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

type Child = Node | string | null;

interface Properties {
  class?: string;
  text?: string;
  id?: string;
  /** Attributes as they are written in HTML. */
  attributes?: Record<string, string>;
  on?: { [K in keyof HTMLElementEventMap]?: (event: HTMLElementEventMap[K]) => void };
}

/** An element. Texts are texts: nothing in them is ever read as HTML. */
export function el<K extends keyof HTMLElementTagNameMap>(tag: K, properties: Properties = {}, children: Child[] = []): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  if (properties.class !== undefined) element.className = properties.class;
  if (properties.text !== undefined) element.textContent = properties.text;
  if (properties.id !== undefined) element.id = properties.id;
  for (const [name, value] of Object.entries(properties.attributes ?? {})) element.setAttribute(name, value);
  for (const [name, listener] of Object.entries(properties.on ?? {})) element.addEventListener(name, listener as EventListener);
  element.append(...children.filter((child) => child !== null));
  return element;
}

export function button(text: string, onClick: () => void, properties: Properties = {}): HTMLButtonElement {
  return el("button", { ...properties, text, attributes: { type: "button", ...properties.attributes }, on: { click: onClick } });
}

/** A part of the side panel under a heading. */
export function section(title: string, children: Child[], properties: Properties = {}): HTMLElement {
  const heading = el("h2", { text: title });
  return el("section", { ...properties, attributes: { "aria-label": title, ...properties.attributes } }, [heading, ...children]);
}

/** A part of the side panel that is opened by its heading; it calls `onOpen` when it opens or closes. */
export function collapsible(title: string, children: Child[], onOpen: (isOpen: boolean) => void = () => {}): HTMLDetailsElement {
  const summary = el("summary", {}, [el("h2", { text: title })]);
  const details = el("details", { class: "part", attributes: { role: "group", "aria-label": title } }, [summary, el("div", {}, children)]);
  details.addEventListener("toggle", () => onOpen(details.open));
  return details;
}

/**
 * Calls `update` once before the browser's next picture, however often the result is called before: what is written at every step
 * of a drag would cost more than the step.
 */
export function throttleToFrame(update: () => void): () => void {
  let isWaiting = false;
  return () => {
    if (isWaiting) return;
    isWaiting = true;
    requestAnimationFrame(() => {
      isWaiting = false;
      update();
    });
  };
}

let count = 0;

/** For labels that name what they belong to. */
export function newId(prefix: string): string {
  return `${prefix}-${++count}`;
}

/** Runs what may fail while `control` cannot be pressed again; `onError` receives what was thrown. */
export async function whileBusy(control: HTMLButtonElement, run: () => Promise<void>, onError: (thrown: unknown) => void): Promise<void> {
  control.disabled = true;
  try {
    await run();
  } catch (thrown) {
    onError(thrown);
  } finally {
    control.disabled = false;
  }
}

/** Shows `page` in place of all that is on the page, until the result is called. */
export function coverPage(page: HTMLElement): () => void {
  const others = Array.from(document.body.children).filter((element): element is HTMLElement => element instanceof HTMLElement && !element.hidden);
  others.forEach((element) => (element.hidden = true));
  document.body.append(page);
  return () => {
    page.remove();
    others.forEach((element) => (element.hidden = false));
  };
}

/** Replaces what is made again at each change: the keyboard's focus stays on the control of the same name, or goes to the first one. */
export function renew(element: HTMLElement, children: readonly HTMLElement[]): void {
  const focused = element.contains(document.activeElement) ? nameOf(document.activeElement) : null;
  element.replaceChildren(...children);
  if (focused === null) return;
  const controls = [...element.querySelectorAll<HTMLElement>("button, input, select")];
  const next = controls.find((control) => nameOf(control) === focused) ?? controls[0] ?? element;
  if (next === element) element.tabIndex = -1;
  next.focus();
}

function nameOf(element: Element | null): string {
  return element?.getAttribute("aria-label") ?? element?.textContent ?? "";
}

export interface Choice<T> {
  value: T;
  label: string;
}

/** A list of which one is chosen; `choose` shows another choice without notifying. */
export function select<T>(label: string, choices: Choice<T>[], onChoose: (value: T) => void): { element: HTMLElement; set(choices: Choice<T>[], index: number): void } {
  const id = newId("select");
  let current = choices;
  const control = el("select", { id, on: { change: () => onChoose(current[control.selectedIndex].value) } });
  const set = (next: Choice<T>[], index: number) => {
    current = next;
    control.replaceChildren(...next.map((choice) => el("option", { text: choice.label })));
    control.selectedIndex = index;
  };
  set(choices, 0);
  return { element: el("div", { class: "field" }, [el("label", { text: label, attributes: { for: id } }), control]), set };
}

/** A slider from `least` to `most`. */
export function slider(label: string, range: { least: number; most: number; step: number; value: number }, onInput: (value: number) => void): HTMLInputElement {
  const attributes = {
    type: "range",
    min: String(range.least),
    max: String(range.most),
    step: String(range.step),
    value: String(range.value),
    "aria-label": label,
  };
  const control = el("input", { attributes, on: { input: () => onInput(control.valueAsNumber) } });
  return control;
}
