// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { landmarkMovements } from "../measures/face_measures";
import { cell, describeMovement } from "../planning/landmarks";
import type { Band } from "../measures/evaluation";
import type { MovementBand } from "../measures/movement_bands";
import { movementBandsAtRest } from "../measures/rest_measures";
import { bandText, partsText, plusMinus, wholeBandText } from "../measures/texts";
import type { Workbench } from "../workbench/workbench";
import { el, throttleToFrame, section } from "./dom";
import { Rest } from "./rest";

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
    const parts = el("small");
    const row = el("tr", {}, [el("th", { attributes: { scope: "row" } }, [landmark.label, parts]), ...cells]);
    return { row, parts, cells };
  });
  // `whole`: null where they are not known, and until they are.
  const draw = (whole: readonly (MovementBand | null)[] | null) => {
    const movements = landmarkMovements(bench);
    caption.textContent = [captionOf(headFrame.source), bandCaption(whole, movements.some(({ bandMm }) => bandMm !== null))].filter((text) => text !== "").join(" ");
    rows.forEach(({ row, parts, cells }, index) => {
      const movement = movements[index];
      const band = whole === null ? materialBand(movement) : whole[index];
      WAYS.forEach((way, column) => fill(cells[column], cell(movement[way]), plusMinus(band?.[way] ?? null)));
      fill(cells[3], cell(movement.totalMm), bandText(band?.totalMm ?? null));
      parts.textContent = partsText(band?.totalMm ?? null);
      row.title = describeMovement(movement);
    });
  };
  const rest = new Rest();
  let hasChoice = false;
  const show = () => {
    rest.over();
    const atOnce = bench.answersAtOnce && landmarks.length > 0;
    if (!atOnce || !rest.isQuick) draw(null);
    if (bench.showsPlan && landmarks.length > 0) rest.begin(() => movementBandsAtRest(bench, bench.planAnswers), (whole) => {
      draw(whole);
      if (whole !== null && !hasChoice) void import("./operation_choice").then(({ showOperationChoice }) => showOperationChoice(bench, table)).then(() => (hasChoice = true));
    }, atOnce);
  };
  bench.shown.watch(throttleToFrame(show));
  const heads = ["Landmark", "Forward", "Left", "Up", "Total"].map((text) => el("th", { text, attributes: { scope: "col" } }));
  const table = el("table", { class: "movements" }, [caption, el("thead", {}, [el("tr", {}, heads)]), el("tbody", {}, rows.map(({ row }) => row))]);
  return section("Movements", [landmarks.length === 0 ? el("p", { class: "quiet", text: "The case has no landmarks." }) : table]);
}

const WAYS = ["forwardMm", "leftMm", "upMm"] as const;

function bandCaption(whole: readonly (MovementBand | null)[] | null, hasMaterial: boolean): string {
  if (whole !== null) return `${wholeBandText("a number", whole.flatMap((band) => (band === null ? [] : [band.totalMm])))} Below a name: how far each of them alone would reach in the total.`;
  return hasMaterial ? "Below a number of the skin: 95 % interval, material uncertainty only." : "";
}

/** That of the material alone; null for bone, and where none is known. */
function materialBand({ bandMm, ...movement }: ReturnType<typeof landmarkMovements>[number]): Record<keyof MovementBand, Band> | null {
  if (bandMm === null) return null;
  const about = (value: number, least = -Infinity): Band => ({ lowest: Math.max(least, value - bandMm), highest: value + bandMm });
  return { forwardMm: about(movement.forwardMm), leftMm: about(movement.leftMm), upMm: about(movement.upMm), totalMm: about(movement.totalMm, 0) };
}
