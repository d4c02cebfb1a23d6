// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { draftTimes, listDrafts, removeDraft } from "../building/build_drafts";
import { messageOf } from "../calls/call_error";
import type { Gateway } from "../calls/gateway";
import type { BuildDraft } from "../generated/tissueform/v1/plan_build_service_pb";
import { button, el } from "../panels/dom";
import { formatBytes } from "../planning/numbers";

/** Received CTs that wait for a plan; hidden while the list is empty, as it is with a server that builds no plans, or an older one. */
export function draftsList(gateway: Gateway, onOpen: (draft: BuildDraft) => void, onProblem: (text: string) => void): HTMLElement {
  const list = el("ul", { class: "cases drafts" });
  const element = el("section", { attributes: { "aria-label": "Drafts" } }, [
    el("h2", { text: "Drafts" }),
    el("p", { class: "quiet", text: "CTs that were received from the PACS and wait for a plan." }),
    list,
  ]);
  element.hidden = true;
  const show = (drafts: readonly BuildDraft[]) => {
    list.replaceChildren(...drafts.map((draft) => draftItem(draft, onOpen, () => void remove(draft.name))));
    element.hidden = drafts.length === 0;
  };
  const remove = async (name: string) => {
    try {
      await removeDraft(gateway, name);
      show(await listDrafts(gateway));
    } catch (thrown) {
      onProblem(`The draft cannot be removed. ${messageOf(thrown)}`);
    }
  };
  void listDrafts(gateway).then(show, () => {});
  return element;
}

function draftItem(draft: BuildDraft, onOpen: (draft: BuildDraft) => void, onRemove: () => void): HTMLElement {
  const title = draft.title === "" ? "Untitled" : draft.title;
  const open = el("button", { attributes: { type: "button" }, on: { click: () => onOpen(draft) } }, [
    el("strong", { text: title }),
    el("small", { text: `${formatBytes(Number(draft.totalBytes))} · ${draftTimes(draft)}` }),
  ]);
  return el("li", {}, [open, removeButtons(title, onRemove)]);
}

/** The CT goes with the draft, so a click asks first. */
function removeButtons(title: string, onRemove: () => void): HTMLElement {
  const named = (text: string) => ({ attributes: { "aria-label": `${text} ${title}` } });
  const box = el("div", { class: "buttons" });
  const ask = button("Remove", () => {
    box.replaceChildren(really, keep);
    keep.focus();
  }, named("Remove"));
  const really = button("Remove the CT", onRemove, named("Remove the CT of"));
  const keep = button("Keep", () => {
    box.replaceChildren(ask);
    ask.focus();
  }, named("Keep"));
  box.append(ask);
  return box;
}
