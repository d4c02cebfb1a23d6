// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { formatNumber } from "../planning/numbers";
import type { Cut } from "../scene/head";
import type { HeadView } from "../scene/head_view";
import type { Stage } from "../scene/stage";
import { VIEWS, type ViewName, edgeLetters, scaleBar } from "../scene/views";
import { button, el, select, slider } from "./dom";

/** What is looked at: one head, or several by one camera. */
export type LookedAt = Pick<HeadView, "look" | "setGhost" | "setSkinOpacity" | "setCut"> & { head: { radius: number } };

/** How the head is looked at: views, transparency, cut, ghost. */
export function viewBar(view: LookedAt): HTMLElement {
  const views = (Object.keys(VIEWS) as ViewName[]).map((name) =>
    button(VIEWS[name].label, () => view.look(name), { attributes: { title: `Key ${VIEWS[name].key}` } }),
  );
  const ghost = button("Pre-op ghost", () => {
    const isOn = ghost.getAttribute("aria-pressed") !== "true";
    ghost.setAttribute("aria-pressed", String(isOn));
    view.setGhost(isOn);
  }, { attributes: { "aria-pressed": "false", title: "Pre-op face as ghost overlay" } });
  const opacity = slider("Opacity of the skin", { least: 0, most: 1, step: 0.01, value: 1 }, (value) => view.setSkinOpacity(value));
  return el("div", { class: "viewbar", attributes: { role: "toolbar", "aria-label": "View" } }, [
    el("div", { class: "group", attributes: { role: "group", "aria-label": "Look from" } }, views),
    el("label", { class: "inline" }, ["Skin", opacity]),
    cutField(view),
    ghost,
  ]);
}

function cutField(view: LookedAt): HTMLElement {
  let axis: Cut["axis"] | null = null;
  const reach = Math.ceil(view.head.radius);
  const at = slider("Place of the cut", { least: -reach, most: reach, step: 1, value: 0 }, () => show());
  const show = () => {
    at.disabled = axis === null;
    at.setAttribute("aria-valuetext", `${formatNumber(at.valueAsNumber, 0)} millimeters from the middle`);
    view.setCut(axis === null ? null : { axis, atMm: at.valueAsNumber });
  };
  const choices = [
    { value: null, label: "None" },
    { value: "x" as const, label: "Left side off" },
    { value: "z" as const, label: "Front off" },
    { value: "y" as const, label: "Top off" },
  ];
  const field = select<Cut["axis"] | null>("Cut", choices, (value) => {
    axis = value;
    at.value = "0";
    show();
  });
  at.disabled = true;
  field.element.append(at);
  return field.element;
}

/** Letters at the edges of the picture and a bar of so many mm; call `update` when the camera has moved. */
export function pictureMarks(stage: Pick<Stage, "camera" | "millimetresPerPixel">): { element: HTMLElement; update(): void } {
  const letters = {
    left: el("span", { class: "letter at-left" }),
    right: el("span", { class: "letter at-right" }),
    top: el("span", { class: "letter at-top" }),
    bottom: el("span", { class: "letter at-bottom" }),
  };
  const bar = el("span", { class: "bar" });
  const length = el("span");
  const scale = el("div", { class: "scale" }, [length, bar]);
  const element = el("div", { class: "marks", attributes: { "aria-hidden": "true" } }, [...Object.values(letters), scale]);
  const update = () => {
    const names = edgeLetters(stage.camera);
    for (const edge of ["left", "right", "top", "bottom"] as const) letters[edge].textContent = names[edge];
    const { mm, px } = scaleBar(stage.millimetresPerPixel);
    bar.style.width = `${px}px`;
    length.textContent = `${mm} mm`;
  };
  return { element, update };
}
