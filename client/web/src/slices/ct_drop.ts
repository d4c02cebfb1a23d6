// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { messageOf } from "../calls/call_error";
import { button, el, whileBusy } from "../panels/dom";
import { pagePart } from "../panels/page_part";
import { droppedFiles, filesOf } from "../volume/dropped_files";
import type { DroppedFile } from "../volume/opened_ct";
import type { Volume } from "../volume/volume";
import type { Workbench } from "../workbench/workbench";
import { fitOfCt, objectionToCt } from "./ct_fit";

/** The series that the rule proposes. Rejects with one sentence. */
async function readCt(files: readonly DroppedFile[]): Promise<Volume> {
  const { openCt } = await pagePart(() => import("../volume/opened_ct"));
  const opened = await openCt(files, () => {});
  try {
    if (opened.proposed === null) throw new Error(opened.series[0]?.objections[0] ?? opened.notes[0] ?? "open the folder of one CT series");
    return await opened.read(opened.proposed, () => {});
  } finally {
    opened.close();
  }
}

/** Opens a CT of the case's patient, chosen or dropped upon `target`, and shows it in the slices where it has the case's skin. It stays in the page. */
export function ctDrop(bench: Workbench, target: HTMLElement): HTMLElement {
  const take = async (files: Promise<readonly DroppedFile[]>) => {
    const all = await files;
    if (all.length === 0) return;
    bench.notice.value = "Reading the CT.";
    const volume = await readCt(all);
    const fit = fitOfCt(volume, bench.file.surfaces.filter(({ entry }) => entry.kind === "skin"));
    const objection = objectionToCt(fit);
    if (objection !== "") throw new Error(objection);
    bench.volume.value = volume;
    bench.notice.value = `The slices show the CT: it has skin where ${(100 * fit.share).toFixed(0)} % of the case's skin is.`;
  };
  const open = (files: Promise<readonly DroppedFile[]>) => void whileBusy(control, () => take(files), (thrown) => (bench.notice.value = messageOf(thrown)));
  const input = el("input", { attributes: { type: "file", multiple: "", hidden: "", "aria-label": "CT of this case" } });
  input.addEventListener("change", () => {
    open(Promise.resolve(filesOf(input.files)));
    input.value = "";
  });
  const control: HTMLButtonElement = button("Open a CT", () => input.click(), { attributes: { title: "Files of the CT that the case was built from; a folder can be dropped on the slices" } });
  target.addEventListener("dragover", (event) => event.preventDefault());
  target.addEventListener("drop", (event) => {
    event.preventDefault();
    if (event.dataTransfer !== null) open(droppedFiles(event.dataTransfer));
  });
  return el("div", { class: "group" }, [control, input]);
}
