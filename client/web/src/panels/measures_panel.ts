// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { hasHeadFrame } from "../measures/face_point";
import { labelOf, measureFace } from "../measures/face_measures";
import type { MeasureResult } from "../measures/evaluation";
import { measureAtRest } from "../measures/rest_measures";
import { bandText, normText, partsText, unitText, valueTexts, wholeBandText, whyNot } from "../measures/texts";
import type { Workbench } from "../workbench/workbench";
import { collapsible, el, throttleToFrame } from "./dom";
import { landmarksPart } from "./landmarks_part";
import { ownMeasuresPart } from "./own_measures_part";
import { Rest } from "./rest";

/** The face in numbers: a table, the landmarks that it is made from, and distances and angles of one's own. */
export function measuresPanel(bench: Workbench): HTMLElement {
  const body = el("tbody");
  const heads = ["Measure", "Before", "After", "Change"].map((text) => el("th", { text, attributes: { scope: "col" } }));
  const caption = el("caption");
  const table = el("table", { class: "measures" }, [caption, el("thead", {}, [el("tr", {}, heads)]), body]);
  const landmarks = landmarksPart(bench);
  const rest = new Rest();
  const draw = (results: readonly MeasureResult[]) => {
    body.replaceChildren(...results.map((result) => row(bench, result)));
    caption.textContent = captionOf(bench, results);
  };
  const show = () => {
    rest.over();
    if (!panel.open) return;
    const atOnce = bench.answersAtOnce;
    if (!atOnce || !rest.isQuick) draw(measureFace(bench));
    if (bench.showsPlan) rest.begin(() => measureAtRest(bench, bench.planAnswers), draw, atOnce);
  };
  const panel: HTMLDetailsElement = collapsible("Measures", [table, landmarks.element, ownMeasuresPart(bench)], (isOpen) => {
    landmarks.show(isOpen);
    show();
  });
  bench.shown.watch(throttleToFrame(show));
  bench.landmarks.onChange(throttleToFrame(show));
  return panel;
}

function captionOf(bench: Workbench, results: readonly MeasureResult[]): string {
  const bands = results.flatMap((result) => (result.kind === "value" && result.band !== null ? [result.band] : []));
  const [hasBand, isWhole] = [bands.length > 0, bands.some(({ parts }) => parts !== undefined)];
  return [
    `In the ${hasHeadFrame(bench.file) ? "head frame" : "scanner axes (no head frame was found)"}; forward, up and the patient’s left are positive.`,
    isWhole ? `${wholeBandText("“after”", bands)} Below a name: how far each of them alone would reach.` : "",
    hasBand && !isWhole ? "Below “after”: 95 % interval, material uncertainty only." : "",
    !isWhole && bench.hasBand && bench.whyNoBand !== "" ? `No 95 % interval: ${bench.whyNoBand}.` : "",
    bench.showsPlan ? "" : `The face that is shown is not the plan’s${hasBand ? "" : "; it has no 95 % interval"}.`,
  ].filter((text) => text !== "").join(" ");
}

function row(bench: Workbench, result: MeasureResult): HTMLElement {
  const { definition } = result;
  const band = result.kind === "value" ? result.band : null;
  const remarks = [normText(definition.norm), partsText(band)].filter((text) => text !== "").map((text) => el("small", { text }));
  const name = el("th", { attributes: { scope: "row" } }, [`${definition.title}, ${unitText(result)}`, ...remarks]);
  const why = whyNot(result, (landmark) => labelOf(bench.landmarks, landmark));
  if (why !== "") return el("tr", { attributes: { "data-measure": definition.name } }, [name, el("td", { class: "quiet", text: why, attributes: { colspan: "3" } })]);
  const [before, after, change] = valueTexts(result);
  return el("tr", { attributes: { "data-measure": definition.name } }, [
    name,
    el("td", { text: before }),
    el("td", {}, [after, band === null ? null : el("small", { class: "band", text: bandText(band) })]),
    el("td", { text: change }),
  ]);
}
