// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { NOTICE } from "../exports/files";
import { provenanceLines } from "../exports/plan_export";
import { ProfileDrawing } from "../exports/profile_svg";
import type { MeasureResult } from "../measures/evaluation";
import { labelOf } from "../measures/face_measures";
import { measureAtRest } from "../measures/rest_measures";
import { bandText, intervalOf, normText, unitText, valueTexts, whyNot } from "../measures/texts";
import { formatNumber } from "../planning/numbers";
import { pivotChoices, pivotText } from "../planning/pivots";
import { MOVE_KEYS } from "../planning/plan";
import { type ShownAnswer, describeFace, modelShown } from "../workbench/shown_answer";
import type { Workbench } from "../workbench/workbench";
import { reportPictures } from "./report_pictures";

// One page for the patient's file, without anything that says whose it is: no title of the case, no name, no date of birth. Texts
// are texts; nothing in them is read as HTML.

const HEADS: Readonly<Record<string, string>> = { forwardMm: "Forward, mm", leftMm: "Left, mm", upMm: "Up, mm", pitchDeg: "Pitch, °", rollDeg: "Roll, °", yawDeg: "Yaw, °" };

function node(tag: string, content: (Node | string)[], className = ""): HTMLElement {
  const element = document.createElement(tag);
  if (className !== "") element.className = className;
  element.append(...content);
  return element;
}

function table(heads: readonly string[], rows: readonly (readonly (Node | string)[])[]): HTMLElement {
  const cells = (tag: string, of: readonly (Node | string)[]) => node("tr", of.map((content) => node(tag, [content])));
  return node("table", [node("thead", [cells("th", heads)]), node("tbody", rows.map((row) => cells("td", row)))]);
}

/** The sheet of what is shown now. Its pictures are `data:` addresses, so that it is whole wherever it is kept. */
export async function reportSheet(bench: Workbench): Promise<HTMLElement> {
  const results = await measureAtRest(bench, bench.planAnswers);
  const pictures = await reportPictures(bench);
  return node("article", [
    node("header", [node("h1", ["Surgical plan and predicted face"]), node("p", [`${NOTICE[0].toUpperCase()}${NOTICE.slice(1)}: a prediction by a model, not for diagnosis or treatment.`], "report-notice")]),
    node("section", [node("h2", ["Plan"]), planTable(bench)]),
    node("section", [node("h2", ["Measures"]), measureTable(bench, results)], "wide"),
    node("section", [node("h2", ["Profile"]), new ProfileDrawing(bench).draw()]),
    node("section", [node("h2", ["Pictures"]), node("div", pictures, "pictures")]),
    node("section", [node("h2", ["Origin"]), facts(bench, results)], "wide"),
  ], "report");
}

function planTable(bench: Workbench): HTMLElement {
  const { landmarks } = bench.file.manifest;
  const rows = bench.plan.handles.map((handle, index) => {
    const pivots = pivotChoices(handle, landmarks, bench.view.head.segmentMiddle(handle.name));
    return [handle.label, ...MOVE_KEYS.map((key) => formatNumber(bench.plan.moves[index][key])), pivotText(pivots, bench.plan.pivot(index))];
  });
  return table(["Segment", ...MOVE_KEYS.map((key) => HEADS[key]), "Of and about (at rest, LPS, mm)"], rows);
}

function measureTable(bench: Workbench, results: readonly MeasureResult[]): HTMLElement {
  const rows = results.map((result) => {
    const why = whyNot(result, (name) => labelOf(bench.landmarks, name));
    const [before, after, change] = valueTexts(result);
    const band = result.kind === "value" ? bandText(result.band) : "";
    return [`${result.definition.title}, ${unitText(result)}`, before, why === "" ? after : why, band, change, normText(result.definition.norm).replace("norm ", "")];
  });
  return table(["Measure", "Before", "After", "95 % interval", "Change", "Norm"], rows);
}

/** Which model's answer the face is that is shown, how near it is to that model's full one, and who gave it. */
export function answerLine(bench: Pick<Workbench, "comparison" | "model" | "modelInfo"> & { answer: { value: ShownAnswer | null } }): string {
  const [answer, comparison] = [bench.answer.value, bench.comparison.value];
  const model = bench.modelInfo(modelShown(comparison, bench.model.value))?.name ?? "unknown";
  const isOwn = answer?.by === "page" && (comparison === null || (comparison.share === 0 && comparison.from === "plan"));
  return `model ${model}. ${describeFace(answer, comparison) || "No answer yet."}${isOwn ? " Computed by the page; not yet confirmed by the server." : ""}`;
}

/** What the intervals of the measures include, or why the measures have no intervals. */
export function intervalLine(results: readonly MeasureResult[], why: string): string {
  const bands = results.flatMap((result) => (result.kind === "value" && result.band !== null ? [result.band] : []));
  const whole = bands.find(({ parts }) => parts !== undefined);
  if (whole !== undefined) return `95 % interval: ${intervalOf(whole)} together, with deviations of surgery and model: ${whole.parts?.source}`;
  return bands.length > 0 || why === "" ? "95 % interval, material uncertainty only; excludes model and surgical error" : `no 95 % interval: ${why}`;
}

function facts(bench: Workbench, results: readonly MeasureResult[]): HTMLElement {
  const lines = [
    `made ${new Date().toISOString()}`,
    answerLine(bench),
    intervalLine(results, bench.whyNoBand),
    "mm and degrees in the head frame: forward, up and the patient's left are positive",
    ...provenanceLines(bench).filter((line) => !line.startsWith("model")),
  ];
  return node("ul", lines.filter((line) => line !== "").map((line) => node("li", [line])));
}
