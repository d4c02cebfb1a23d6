// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { messageOf } from "../calls/call_error";
import { download } from "../exports/files";
import { button, el, newId, section } from "../panels/dom";
import type { PlanDraft } from "./plan_draft";
import { parseDraft, recipeText } from "./recipe";
import { type Step, problemBox } from "./step";

/** The recipe as text: all that was chosen, also for `tissueform plan build`. */
export function recipeStep(draft: PlanDraft): Step {
  const problem = problemBox();
  const id = newId("recipe");
  const text = el("textarea", { id, class: "recipe", attributes: { spellcheck: "false", rows: "24", autocomplete: "off" } });
  const take = (json: string) => {
    problem.show("");
    try {
      draft.change(parseDraft(json));
    } catch (thrown) {
      problem.show(messageOf(thrown));
    }
  };
  const fileId = newId("recipe-file");
  const file = el("input", { id: fileId, attributes: { type: "file", accept: ".json" } });
  file.addEventListener("change", () => void file.files?.[0]?.text().then(take).finally(() => (file.value = "")));
  const element = section("Recipe", [
    el("p", { class: "quiet", text: "The same recipe and CT give the same plan with tissueform plan build on the command line." }),
    el("label", { text: "Recipe (JSON)", attributes: { for: id } }),
    text,
    problem.element,
    el("div", { class: "buttons" }, [button("Apply the text", () => take(text.value)), button("Download the recipe", () => download("recipe.json", new Blob([recipeText(draft.recipe)], { type: "application/json" })))]),
    el("div", { class: "file-field" }, [el("label", { text: "Load a recipe", attributes: { for: fileId } }), file]),
  ]);
  const update = () => {
    if (document.activeElement !== text) text.value = recipeText(draft.recipe);
  };
  return { title: "Recipe", element, needsCt: false, update };
}
