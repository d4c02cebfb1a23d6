// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { messageOf } from "../calls/call_error";
import type { HeadView } from "../scene/head_view";
import type { Stage, StageListener } from "../scene/stage";
import { button, el, throttleToFrame, whileBusy } from "./dom";
import { pictureMarks } from "./view_bar";

const LOST = "The browser lost access to the graphics card, so the picture is not drawn. Numbers and sliders still work.";

/**
 * Where a head is drawn, with what lies over every picture: letters, scale, and a word where there is no picture. Make the view in
 * `element` with `listener`, then call `dress`.
 */
export class PictureBox {
  readonly element = el("div", { class: "picture", attributes: { role: "region", "aria-label": "Picture of the head" } });
  readonly listener: StageListener = {
    onDrawn: () => this.update(),
    onContext: (isLost) => {
      this.showLost(isLost);
      this.onContext(isLost);
    },
  };
  private update = () => {};
  private showLost: (isLost: boolean) => void = () => {};

  constructor(private readonly onContext: (isLost: boolean) => void) {}

  /** `label`: what the picture is and how it is turned, for those who do not see it. */
  dress({ stage }: Pick<HeadView, "stage">, label: string): void {
    stage.surface.setAttribute("aria-label", label);
    stage.surface.setAttribute("role", "application");
    const marks = pictureMarks(stage);
    this.update = throttleToFrame(marks.update);
    const lost = lostBox(stage);
    this.showLost = lost.show;
    this.element.append(marks.element, lost.element);
    if (!stage.hasRenderer) this.element.append(noPicture());
    marks.update();
  }
}

/** In place of a picture that the browser cannot draw. */
export function noPicture(): HTMLElement {
  const text = "This browser shows no 3D pictures (WebGL is off or missing). Everything else works.";
  return el("p", { class: "no-picture", text, attributes: { role: "alert" } });
}

/** Over a picture that the browser has stopped: why, and the way to go on. */
export function lostBox(stage: Pick<Stage, "restore">): { element: HTMLElement; show(isLost: boolean): void } {
  const text = el("span");
  const restore = button("Restore picture", () => void whileBusy(restore, () => stage.restore(), (thrown) => (text.textContent = messageOf(thrown))));
  const element = el("div", { class: "no-picture", attributes: { role: "alert" } }, [el("p", {}, [text]), restore]);
  element.hidden = true;
  return {
    element,
    show(isLost) {
      element.hidden = !isLost;
      text.textContent = LOST;
    },
  };
}
