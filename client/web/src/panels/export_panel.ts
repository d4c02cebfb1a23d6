// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { messageOf } from "../calls/call_error";
import { download, toPly, toPng, toStl } from "../exports/files";
import { measureAtRest, movementBandsAtRest } from "../measures/rest_measures";
import type { Workbench } from "../workbench/workbench";
import { button, el, section, whileBusy } from "./dom";
import { movingFilePart } from "./moving_file_part";

/** Fetched when something is saved. */
const planExport = () => import("../exports/plan_export");
const casePlan = () => import("../exports/case_plan");

/** What is shown, as files. Names of files hold nothing of the patient. */
export function exportPanel(bench: Workbench): HTMLElement {
  const reportingErrors = (run: () => void | Promise<void>) => async () => {
    try {
      await run();
    } catch (thrown) {
      bench.notice.value = messageOf(thrown);
    }
  };
  const save = (name: string, type: string, content: BlobPart) => download(name, new Blob([content], { type }));
  const remark = () => `Model ${bench.modelInfo(bench.model.value)?.name ?? "unknown"}`;
  const png = async () => {
    const picture = await bench.view.stage.snapshot();
    if (picture === null) throw new Error("this browser cannot draw 3D pictures");
    const background = getComputedStyle(document.body).backgroundColor;
    download("tissueform.png", await toPng(picture, background, remark()));
  };
  const stl = async (what: "skin" | "all", name: string) => save(name, "model/stl", toStl((await planExport()).exportedSurfaces(bench, what), remark()));
  const ply = async () => {
    const { exportedSurfaces, provenanceLines } = await planExport();
    save("tissueform-face.ply", "application/octet-stream", toPly(exportedSurfaces(bench, "skin"), provenanceLines(bench)));
  };
  const plan = async () => {
    const [{ planDocument }, { plannedRanges }] = await Promise.all([planExport(), casePlan()]);
    const ranges = await plannedRanges(bench.file);
    const atRest = { measures: await measureAtRest(bench, bench.planAnswers), movements: await movementBandsAtRest(bench, bench.planAnswers) };
    save("tissueform-plan.json", "application/json", planDocument(bench, atRest, ranges));
  };
  return section("Export", [
    el("div", { class: "buttons" }, [
      button("Face STL", reportingErrors(() => stl("skin", "tissueform-face.stl"))),
      button("All STL", reportingErrors(() => stl("all", "tissueform-all.stl"))),
      button("Face PLY", reportingErrors(ply)),
      button("Picture", reportingErrors(png)),
      button("Plan JSON", reportingErrors(plan)),
      caseButton(bench),
    ]),
    el("p", { class: "quiet", text: "In mm, LPS, as shown. Plan JSON uses Case file as its mesh: save both in one folder. Every file states: not a medical device." }),
    movingFilePart(bench),
  ]);
}

/** The file that an exported plan names as its mesh. */
function caseButton(bench: Workbench): HTMLElement {
  const { source } = bench.file;
  const run = async () => download((await casePlan()).CASE_FILE, new Blob([await source.read(0, source.totalBytes)], { type: "model/gltf-binary" }));
  const control = button("Case file", () => void whileBusy(control, run, (thrown) => (bench.notice.value = messageOf(thrown))));
  return control;
}
