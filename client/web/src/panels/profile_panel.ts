// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { messageOf } from "../calls/call_error";
import { download } from "../exports/files";
import { ProfileDrawing, svgText, toPicture } from "../exports/profile_svg";
import type { Workbench } from "../workbench/workbench";
import { button, collapsible, el, throttleToFrame } from "./dom";

/** The midsagittal section before and after, redrawn as the face moves while it is open. */
export function profilePanel(bench: Workbench): HTMLElement {
  const sheet = el("div", { class: "profile" });
  let drawing: ProfileDrawing | null = null;
  let isNoseLeft = false;
  const show = () => {
    if (!panel.open) return;
    drawing ??= new ProfileDrawing(bench);
    sheet.replaceChildren(drawing.draw(isNoseLeft));
  };
  const turn = button("Nose to the left", () => {
    isNoseLeft = !isNoseLeft;
    turn.setAttribute("aria-pressed", String(isNoseLeft));
    show();
  }, { attributes: { "aria-pressed": "false" } });
  const drawn = () => (drawing ??= new ProfileDrawing(bench)).draw(isNoseLeft);
  const png = () => {
    const save = toPicture(drawn()).then((blob) => download("tissueform-profile.png", blob));
    save.catch((thrown) => (bench.notice.value = messageOf(thrown)));
  };
  const panel: HTMLDetailsElement = collapsible("Profile", [
    sheet,
    el("div", { class: "buttons" }, [
      turn,
      button("Profile SVG", () => download("tissueform-profile.svg", new Blob([svgText(drawn())], { type: "image/svg+xml" }))),
      button("Profile PNG", png),
    ]),
  ], show);
  bench.shown.watch(throttleToFrame(show));
  bench.landmarks.onChange(throttleToFrame(show));
  return panel;
}
