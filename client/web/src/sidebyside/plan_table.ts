// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { el } from "../panels/dom";
import type { Cell, Row, RowGroup } from "./table_rows";

/** What stands over a column. */
interface Column {
  label: string;
  isActive: boolean;
}

/** Plans as columns, their numbers as rows. */
export class PlanTable {
  readonly element: HTMLElement;
  private readonly table = el("table");

  constructor() {
    this.element = el("section", { class: "plan-table", attributes: { "aria-label": "Numbers of the plans", tabindex: "0" } }, [this.table]);
  }

  show(columns: readonly Column[], groups: readonly RowGroup[], caption: string): void {
    const heads = ["", "Pre-op"].map((text) => (text === "" ? el("td") : el("th", { text, attributes: { scope: "col" } })));
    const plans = columns.map(({ label, isActive }) => el("th", { text: label, class: isActive ? "active" : "", attributes: { scope: "col" } }));
    this.table.replaceChildren(
      el("caption", { text: caption }),
      el("thead", {}, [el("tr", {}, [...heads, ...plans])]),
      ...groups.map((group) => groupBody(group, columns.length)),
    );
  }
}

function groupBody({ title, rows }: RowGroup, plans: number): HTMLElement {
  const head = el("tr", {}, [el("th", { class: "group", text: title, attributes: { scope: "rowgroup", colspan: String(plans + 2) } })]);
  return el("tbody", {}, [head, ...rows.map(rowElement)]);
}

function rowElement({ id, title, note, preOp, cells }: Row): HTMLElement {
  const name = el("th", { attributes: { scope: "row" } }, [title, note === "" ? null : el("small", { text: note })]);
  return el("tr", { attributes: { "data-row": id } }, [name, el("td", { text: preOp }), ...cells.map(cellElement)]);
}

function cellElement(cell: Cell | null): HTMLElement {
  if (cell === null) return el("td", { class: "quiet", text: "…" });
  const notes = cell.notes.map((text) => el("small", { text }));
  return el("td", {}, [cell.text, ...notes, cell.warning === "" ? null : el("small", { class: "warning", text: cell.warning })]);
}
