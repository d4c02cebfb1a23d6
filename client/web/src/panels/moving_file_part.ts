// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { messageOf } from "../calls/call_error";
import { download } from "../exports/files";
import { LEAST_PASSWORD_LETTERS } from "../movingdata/password";
import { pagePart } from "./page_part";
import type { Workbench } from "../workbench/workbench";
import { button, el, newId, whileBusy } from "./dom";

/** One page in which the face moves without a server, with the plan as it is and under a password if one is typed. */
export function movingFilePart(bench: Workbench): HTMLElement {
  const id = newId("password");
  const password = el("input", {
    id,
    attributes: { type: "password", autocomplete: "new-password", maxlength: "256", placeholder: `none, or at least ${LEAST_PASSWORD_LETTERS} letters` },
  });
  const photograph = el("input", { attributes: { type: "checkbox" } });
  const choice = el("label", { class: "check" }, [photograph, "Include the photograph: it identifies the patient"]);
  bench.photograph.watch((bound) => {
    choice.hidden = bound === null;
    photograph.checked &&= bound !== null;
  });
  const make = async () => {
    const answers = bench.local.heldColumns;
    if (answers === null) throw new Error("a moving file needs the model's columns in this page: choose a model with prepared answers, and wait until they are loaded");
    const model = bench.modelInfo(bench.model.value)?.name ?? "";
    const poses = bench.posesByHandle(bench.plan.poses());
    const { movingFile } = await pagePart(() => import("../exports/moving_export"));
    download("tissueform-moves.html", await movingFile(bench.file, { poses, model, answers, photograph: photograph.checked ? bench.photograph.value : null }, password.value));
    password.value = "";
  };
  const save: HTMLButtonElement = button("Moving file", () => {
    void whileBusy(save, make, (thrown) => (bench.notice.value = messageOf(thrown)));
  });
  return el("div", { class: "moving-part" }, [
    el("div", { class: "field" }, [el("label", { text: "Password", attributes: { for: id } }), password]),
    choice,
    save,
    el("p", { class: "quiet", text: "One page with this plan that works without a server. This file shows an identifiable face. Handle it like a patient photograph; a password encrypts it." }),
  ]);
}
