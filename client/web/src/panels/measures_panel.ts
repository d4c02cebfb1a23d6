// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { hasHeadFrame } from "../measures/face_point";
import { labelOf, measureFace } from "../measures/face_measures";
import type { MeasureResult } from "../measures/evaluation";
import { bandText, normText, unitText, valueTexts, whyNot } from "../measures/texts";
import type { Workbench } from "../workbench/workbench";
import { collapsible, el, throttleToFrame } from "./dom";
import { landmarksPart } from "./landmarks_part";
import { ownMeasuresPart } from "./own_measures_part";

/** The face in numbers: a table, the landmarks that it is made from, and distances and angles of one's own. */
export function measuresPanel(bench: Workbench): HTMLElement {
  const body = el("tbody");
  const heads = ["Measure", "Before", "After", "Change"].map((text) => el("th", { text, attributes: { scope: "col" } }));
  const caption = el("caption");
  const table = el("table", { class: "measures" }, [caption, el("thead", {}, [el("tr", {}, heads)]), body]);
  const landmarks = landmarksPart(bench);
  const show = () => {
    if (!panel.open) return;
    const results = measureFace(bench);
    body.replaceChildren(...results.map((result) => row(bench, result)));
    caption.textContent = captionOf(bench, results);
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
  const hasBand = results.some((result) => result.kind === "value" && result.band !== null);
  return [
    `In the ${hasHeadFrame(bench.file) ? "head frame" : "scanner axes (no head frame was found)"}; forward, up and the patient’s left are positive.`,
    hasBand ? "Below “after”: 95 % interval, material uncertainty only." : "",
    bench.hasBand && bench.whyNoBand !== "" ? `No 95 % interval: ${bench.whyNoBand}.` : "",
    bench.showsPlan ? "" : `The face that is shown is not the plan’s${hasBand ? "" : "; it has no 95 % interval"}.`,
  ].filter((text) => text !== "").join(" ");
}

function row(bench: Workbench, result: MeasureResult): HTMLElement {
  const { definition } = result;
  const norm = normText(definition.norm);
  const name = el("th", { attributes: { scope: "row" } }, [`${definition.title}, ${unitText(result)}`, norm === "" ? null : el("small", { text: norm })]);
  const why = whyNot(result, (landmark) => labelOf(bench.landmarks, landmark));
  if (why !== "") return el("tr", { attributes: { "data-measure": definition.name } }, [name, el("td", { class: "quiet", text: why, attributes: { colspan: "3" } })]);
  const [before, after, change] = valueTexts(result);
  const band = result.kind === "value" ? bandText(result.band) : "";
  return el("tr", { attributes: { "data-measure": definition.name } }, [
    name,
    el("td", { text: before }),
    el("td", {}, [after, band === "" ? null : el("small", { class: "band", text: band })]),
    el("td", { text: change }),
  ]);
}
