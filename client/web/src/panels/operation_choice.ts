// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { chosen, deviationTable } from "../measures/deviations";
import type { Workbench } from "../workbench/workbench";
import { el } from "./dom";

/** Below `table`, once: of which operation the deviations of surgery and model are. Nothing where none has its own. */
export async function showOperationChoice(bench: Workbench, table: HTMLElement): Promise<void> {
  const { operations } = await deviationTable();
  if (operations.size === 0 || table.nextElementSibling?.classList.contains("operation")) return;
  const select = el("select", {}, [el("option", { text: "all operations", attributes: { value: "" } }), ...Array.from(operations.keys(), (name) => el("option", { text: name, attributes: { value: name } }))]);
  select.addEventListener("change", () => {
    chosen.operation = select.value;
    bench.shown.value += 1;
  });
  select.value = chosen.operation;
  table.after(el("label", { class: "operation" }, ["Intervals of ", select]));
}
