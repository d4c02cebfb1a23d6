// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { Code, messageOf, toCallError } from "../calls/call_error";
import type { Gateway } from "../calls/gateway";
import { openCase } from "../case/case_file";
import { fileSource, listCases, sha256Of } from "../case/case_sources";
import type { Case } from "../generated/tissueform/v1/case_pb";
import type { BuildDraft } from "../generated/tissueform/v1/plan_build_service_pb";
import { uploadCase } from "../live/upload";
import { formatBytes } from "../planning/numbers";
import { button, el, newId } from "../panels/dom";
import { draftsList } from "./drafts_list";

/** The first page: the server's cases, and a place where a case file is dropped. */
export function casesPage(gateway: Gateway, onOpen: (entry: Case) => void, onNewPlan: (draft: BuildDraft | null) => void, account: HTMLElement | null): HTMLElement {
  const list = el("ul", { class: "cases" });
  const status = el("p", { class: "told", attributes: { role: "status" } });
  const problem = el("p", { class: "problem", attributes: { role: "alert" } });
  const progress = el("progress", { attributes: { max: "1", "aria-label": "Progress" } });
  progress.hidden = true;

  const showList = async () => {
    try {
      list.replaceChildren(...(await listCases(gateway)).map((entry) => caseItem(entry, onOpen)));
      status.textContent = list.childElementCount === 0 ? "The server has no cases yet." : "";
    } catch (thrown) {
      problem.textContent = `The cases cannot be listed. ${messageOf(thrown)}`;
    }
  };
  const take = async (file: File) => {
    problem.textContent = "";
    progress.hidden = false;
    try {
      onOpen(await bringIn(gateway, file, (text, share) => {
        status.textContent = text;
        progress.value = share;
      }));
    } catch (thrown) {
      problem.textContent = messageOf(thrown);
      status.textContent = "";
    } finally {
      progress.hidden = true;
    }
  };
  const newPlan = button("New plan from a CT", () => onNewPlan(null));
  newPlan.hidden = true;
  // A server that builds no plans answers with an error, and an older one, too: the page reports neither.
  void gateway.planBuilds.listPlanBuilds({ pageSize: 1 }).then(() => (newPlan.hidden = false), () => {});
  void showList();
  return el("main", { class: "start" }, [
    el("div", { class: "sheet" }, [
      account,
      el("h1", { text: "Tissueform" }),
      el("p", { class: "lead", text: "Move the bone, see the face follow." }),
      el("h2", { text: "Cases" }),
      list,
      draftsList(gateway, onNewPlan, (text) => (problem.textContent = text)),
      newPlan,
      dropZone((file) => void take(file)),
      status,
      progress,
      problem,
      el("p", { class: "quiet", text: "Not a medical device." }),
    ]),
  ]);
}

function caseItem(entry: Case, onOpen: (entry: Case) => void): HTMLElement {
  const seconds = Number(entry.createTime?.seconds ?? 0n);
  const facts = [formatBytes(Number(entry.totalBytes)), seconds === 0 ? "" : new Date(1000 * seconds).toLocaleDateString()];
  const open = el("button", { attributes: { type: "button" }, on: { click: () => onOpen(entry) } }, [
    el("strong", { text: entry.title === "" ? "Untitled" : entry.title }),
    el("small", { text: facts.filter((fact) => fact !== "").join(" · ") }),
  ]);
  return el("li", {}, [open]);
}

function dropZone(onFile: (file: File) => void): HTMLElement {
  const id = newId("file");
  const input = el("input", { id, attributes: { type: "file", accept: ".tfcase,.glb" } });
  input.addEventListener("change", () => {
    const file = input.files?.[0];
    if (file !== undefined) onFile(file);
    input.value = "";
  });
  const zone = el("div", { class: "drop" }, [el("label", { text: "Drop a case file here, or choose a file", attributes: { for: id } }), input]);
  const mark = (isOver: boolean) => (event: DragEvent) => {
    event.preventDefault();
    zone.classList.toggle("over", isOver);
  };
  zone.addEventListener("dragover", mark(true));
  zone.addEventListener("dragleave", mark(false));
  zone.addEventListener("drop", (event) => {
    mark(false)(event);
    const file = event.dataTransfer?.files[0];
    if (file !== undefined) onFile(file);
  });
  return zone;
}

/** A file is read in full before it is sent: the server keeps bytes, it does not look into them. */
async function bringIn(gateway: Gateway, file: File, onProgress: (text: string, share: number) => void): Promise<Case> {
  const source = fileSource(file);
  const opened = await openCase(source, (done, total) => onProgress("Reading the file", done / total));
  const name = `cases/${await sha256Of(file)}`;
  try {
    return await gateway.cases.getCase({ name });
  } catch (thrown) {
    const error = toCallError(thrown);
    if (error.code !== Code.NotFound) throw error;
  }
  const sha256 = name.replace("cases/", "");
  return uploadCase(gateway, source, sha256, opened.manifest.title, (share) => onProgress("Sending the case", share));
}
