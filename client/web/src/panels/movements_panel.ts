// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { landmarkMovements } from "../measures/face_measures";
import { cell, describeMovement } from "../planning/landmarks";
import { formatNumber } from "../planning/numbers";
import { lengthBand } from "../measures/texts";
import type { Workbench } from "../workbench/workbench";
import { el, throttleToFrame, section } from "./dom";

function captionOf(source: string): string {
  const frame = source === "scanner" ? " Directions are the scanner’s: no head frame was found." : "";
  return `In mm of the head frame; a dot is less than 0.05.${frame}`;
}

/** A number with its band below it; "" where none is known. */
function fill(cell: HTMLElement, number: string, band: string): void {
  if (cell.textContent !== number + band) cell.replaceChildren(number, ...(band === "" ? [] : [el("small", { class: "band", text: band })]));
}

/** Where landmarks go, in mm of the head frame. */
export function movementsPanel(bench: Workbench): HTMLElement {
  const { landmarks, headFrame } = bench.file.manifest;
  const caption = el("caption");
  const rows = landmarks.map((landmark) => {
    const cells = Array.from({ length: 4 }, () => el("td"));
    const row = el("tr", {}, [el("th", { text: landmark.label, attributes: { scope: "row" } }), ...cells]);
    return { row, cells };
  });
  const show = () => {
    const movements = landmarkMovements(bench);
    const hasBand = movements.some(({ bandMm }) => bandMm !== null);
    caption.textContent = `${captionOf(headFrame.source)}${!hasBand ? "" : " Below a number of the skin: 95 % interval, material uncertainty only."}`;
    rows.forEach(({ row, cells }, index) => {
      const { bandMm, ...movement } = movements[index];
      const plusMinus = bandMm === null ? "" : `± ${formatNumber(bandMm)}`;
      [movement.forwardMm, movement.leftMm, movement.upMm].forEach((value, column) => fill(cells[column], cell(value), plusMinus));
      fill(cells[3], cell(movement.totalMm), bandMm === null ? "" : lengthBand(movement.totalMm, bandMm));
      row.title = `${describeMovement(movement)}${bandMm === null ? "" : `, 95 % interval (stiffness only) ${plusMinus} mm`}`;
    });
  };
  bench.shown.watch(throttleToFrame(show));
  const heads = ["Landmark", "Forward", "Left", "Up", "Total"].map((text) => el("th", { text, attributes: { scope: "col" } }));
  const table = el("table", {}, [caption, el("thead", {}, [el("tr", {}, heads)]), el("tbody", {}, rows.map(({ row }) => row))]);
  return section("Movements", [landmarks.length === 0 ? el("p", { class: "quiet", text: "The case has no landmarks." }) : table]);
}
