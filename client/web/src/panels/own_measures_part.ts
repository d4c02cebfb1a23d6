// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { labelOf } from "../measures/face_measures";
import { MOST_OWN_MEASURES } from "../measures/own_measures";
import type { Workbench } from "../workbench/workbench";
import { type Choice, button, collapsible, el, select } from "./dom";

/** Distances between two landmarks and angles at the second of three, chosen from those that are placed. */
export function ownMeasuresPart(bench: Workbench): HTMLElement {
  const book = bench.landmarks;
  const chosen = ["", "", ""];
  const choices = (isOptional: boolean): Choice<string>[] => [
    { value: "", label: isOptional ? "none: a distance" : "choose" },
    ...Array.from(book.placed.keys(), (name) => ({ value: name, label: labelOf(book, name) })),
  ];
  const fields = ["First", "Second, angles at it", "Third"].map((label, index) =>
    select<string>(label, choices(index === 2), (value) => {
      chosen[index] = value;
      update();
    }),
  );
  const add = button("Add", () => {
    book.setOwn([...book.own, { landmarks: chosen.filter((name) => name !== "") }]);
  });
  const list = el("ul", { class: "own-measures" });
  const update = () => {
    const names = chosen.filter((name) => name !== "");
    add.disabled = chosen[0] === "" || chosen[1] === "" || new Set(names).size !== names.length || book.own.length >= MOST_OWN_MEASURES;
  };
  book.onChange(() => {
    fields.forEach((field, index) => {
      const all = choices(index === 2);
      const at = all.findIndex(({ value }) => value === chosen[index]);
      if (at < 0) chosen[index] = "";
      field.set(all, Math.max(0, at));
    });
    list.replaceChildren(...book.own.map(({ landmarks }, index) => {
      const title = landmarks.map((name) => labelOf(book, name)).join(" – ");
      const remove = button("Remove", () => book.setOwn(book.own.filter((_, other) => other !== index)), { attributes: { "aria-label": `Remove ${title}` } });
      return el("li", {}, [el("span", { text: title }), remove]);
    }));
    update();
  });
  update();
  return collapsible("Own distances and angles", [...fields.map(({ element }) => element), el("div", { class: "buttons" }, [add]), list]);
}
