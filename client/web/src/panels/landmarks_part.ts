// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { FaceLandmark } from "../measures/face_landmarks";
import { shownPoint } from "../measures/face_measures";
import type { Workbench } from "../workbench/workbench";
import { button, collapsible, el, throttleToFrame } from "./dom";

/** The list of landmarks: what is placed, what is suggested, and how to place one. `show`: whether their points are drawn. */
export function landmarksPart(bench: Workbench): { element: HTMLElement; show(isShown: boolean): void } {
  const book = bench.landmarks;
  let isShown = false;
  const state = el("p", { class: "quiet" });
  const list = el("ul", { class: "landmarks" });
  const confirm = button("Confirm all", () => book.confirm(Array.from(book.suggestions.keys())), { attributes: { title: "Accept the suggestion after checking it" } });
  const undo = button("Undo landmark", () => book.undo());
  const redo = button("Redo landmark", () => book.redo());
  const own = button("Own point", () => pick(bench, book.nextPoint(), "a point of your own", ["skin", "teeth", "segment", "bone"]));
  const drawPoints = () => {
    bench.view.setPoints("landmark", isShown ? Array.from(book.placed.values(), (anchor) => shownPoint(bench, anchor)) : []);
    bench.view.setPoints("suggestion", isShown ? Array.from(book.suggestions.values(), (anchor) => shownPoint(bench, anchor)) : []);
  };
  const update = () => {
    const { size } = book.suggestions;
    state.textContent = `${book.placed.size} placed${size === 0 ? "" : `, ${size} suggested: look at the yellow points, then confirm`}.`;
    confirm.disabled = size === 0;
    undo.disabled = !book.canUndo;
    redo.disabled = !book.canRedo;
    own.disabled = book.nextPoint() === "";
    list.replaceChildren(...book.landmarks.map((landmark) => item(bench, landmark)));
    drawPoints();
  };
  book.onChange(update);
  bench.shown.watch(throttleToFrame(() => isShown && drawPoints()));
  update();
  const element = el("div", { class: "landmark-part" }, [
    state,
    el("div", { class: "buttons" }, [confirm, undo, redo, own]),
    collapsible("Landmarks", [list]),
  ]);
  return {
    element,
    show(isOpen) {
      isShown = isOpen;
      drawPoints();
    },
  };
}

function item(bench: Workbench, landmark: FaceLandmark): HTMLElement {
  const book = bench.landmarks;
  const { name, label, hint, kinds } = landmark;
  const isPlaced = book.placed.has(name);
  const isSuggested = book.suggestions.has(name);
  const status = isPlaced ? "placed" : isSuggested ? "suggested" : "missing";
  const place = button(isPlaced ? "Move" : "Place", () => pick(bench, name, `${label}: ${hint}`, kinds), { attributes: { "aria-label": `${isPlaced ? "Move" : "Place"} ${label}` } });
  const other = isPlaced
    ? button("Remove", () => book.remove(name), { attributes: { "aria-label": `Remove ${label}` } })
    : button("Confirm", () => book.confirm([name]), { attributes: { "aria-label": `Confirm ${label}` } });
  other.disabled = !isPlaced && !isSuggested;
  return el("li", { attributes: { "data-status": status } }, [el("span", {}, [el("strong", { text: label }), el("small", { text: `${status}; ${hint}` })]), place, other]);
}

/** The next click upon the picture, or Enter in its middle, places it. */
function pick(bench: Workbench, name: string, what: string, kinds: FaceLandmark["kinds"]): void {
  bench.picking.value = {
    prompt: `Click ${what}.`,
    kinds,
    take(anchor) {
      const problem = bench.landmarks.place(name, anchor);
      if (problem === "") bench.picking.value = null;
      else bench.notice.value = problem;
    },
  };
}
