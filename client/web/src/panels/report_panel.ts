// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { messageOf } from "../calls/call_error";
import { download } from "../exports/files";
import { pagePart } from "./page_part";
import type { Workbench } from "../workbench/workbench";
import { button, collapsible, coverPage, el, whileBusy } from "./dom";

/** One page for the patient's file: looked at, printed by the browser (to paper or PDF), or kept as a file. */
export function reportPanel(bench: Workbench): HTMLElement {
  const open = button("Open the report", () => {
    const run = async () => {
      const { reportSheet } = await pagePart(() => import("../report/report_sheet"));
      showReport(await reportSheet(bench));
    };
    void whileBusy(open, run, (thrown) => (bench.notice.value = messageOf(thrown)));
  });
  const text = "Plan, measures, profile, pictures and their origin, as shown now. It contains no patient name; its pictures show the face.";
  return collapsible("Report", [el("p", { class: "quiet", text }), el("div", { class: "buttons" }, [open])]);
}

/** What else is on the page is not printed. */
function showReport(sheet: HTMLElement): void {
  // The planner's own line of words lies below the report.
  const problem = el("p", { attributes: { role: "alert" } });
  const save = async () => {
    const { reportFile } = await pagePart(() => import("../report/report_file"));
    download("tissueform-report.html", new Blob([await reportFile(sheet)], { type: "text/html" }));
  };
  const html = button("Report HTML", () => void whileBusy(html, save, (thrown) => (problem.textContent = messageOf(thrown))));
  const buttons = [button("Print or save as PDF", () => print()), html, button("Back to the plan", () => close())];
  const page = el("main", { class: "report-page", attributes: { "aria-label": "Report" } }, [el("div", { class: "buttons" }, [...buttons, problem]), sheet]);
  page.addEventListener("keydown", (event) => event.key === "Escape" && close());
  const close = coverPage(page);
  buttons[0].focus();
}
