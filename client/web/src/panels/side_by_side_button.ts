// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { messageOf } from "../calls/call_error";
import type { Workbench } from "../workbench/workbench";
import { button, whileBusy } from "./dom";
import { pagePart } from "./page_part";

/** Opens the comparison of plans in place of the planner; it is fetched when it is first opened, and keeps its plans. */
export function sideBySideButton(bench: Workbench): HTMLElement {
  let page: { open(onClosed: () => void): void } | null = null;
  const open = async () => {
    const { SideBySidePage } = await pagePart(() => import("../sidebyside/side_by_side_page"));
    page ??= new SideBySidePage(bench);
    page.open(() => control.focus());
  };
  const run = () => void whileBusy(control, open, (thrown) => (bench.notice.value = messageOf(thrown)));
  const control = button("Side by side", run, { attributes: { title: "Compare two to four plans" } });
  return control;
}
