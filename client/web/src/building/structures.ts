// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { LabelMap } from "../volume/volume";
import type { Recipe } from "./recipe";

/** What the page takes from a label map. */
export type Structure = "mandible" | "skull" | "upper_teeth" | "lower_teeth" | "canal";

// Names as segmentation programs give them (docs/ct-input.md, "Label maps"); teeth before the jaws whose names they contain.
const PATTERNS: readonly (readonly [Structure, RegExp])[] = [
  ["upper_teeth", /upper.*(teeth|tooth)|(teeth|tooth).*upper|maxillary.*(teeth|tooth)/i],
  ["lower_teeth", /lower.*(teeth|tooth)|(teeth|tooth).*lower|mandibular.*(teeth|tooth)/i],
  ["canal", /canal|alveolar.*nerve/i],
  ["mandible", /mandib|lower.?jaw/i],
  ["skull", /skull|cranium|maxilla|upper.?jaw/i],
];

/** Numbers of the label map by structure: as the recipe names them, else by the names of the file. */
export function structuresOf(labels: LabelMap, recipe: Recipe): Map<number, Structure> {
  const found = new Map<number, Structure>();
  for (const [number, name] of labels.names) {
    const pattern = PATTERNS.find(([, expression]) => expression.test(name));
    if (pattern !== undefined) found.set(number, pattern[0]);
  }
  for (const [structure, names] of Object.entries(recipe.labels?.names ?? {})) {
    if (!PATTERNS.some(([known]) => known === structure)) continue;
    for (const [number, name] of labels.names) if (names.includes(name)) found.set(number, structure as Structure);
    names.filter((name) => typeof name === "number").forEach((number) => found.set(number as number, structure as Structure));
  }
  return found;
}
