// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { messageOf } from "../calls/call_error";
import { FitBound, type FittedNumber } from "../generated/tissueform/v1/plan_service_pb";
import { formatNumber } from "../planning/numbers";
import { numberName, targetSentences } from "../workbench/target_sentences";
import type { Workbench } from "../workbench/workbench";
import { button, collapsible, el } from "./dom";

/** The result for the targets: reached or missed, what holds back, how well each number is determined; and to accept or reject it. */
export function targetAnswer(bench: Workbench): HTMLElement {
  const fit = bench.targets;
  const status = el("div", { class: "target-told", attributes: { role: "status" } });
  const rows = el("tbody");
  const heads = ["Number", "Value", "Determined by targets", "Per mm"].map((text) => el("th", { text, attributes: { scope: "col" } }));
  const caption = el("caption", { text: "Scanner axes. Undetermined parameters move least. Per mm: standard deviation if all targets were off by 1 mm." });
  const details = collapsible("How well each parameter is determined", [el("table", {}, [caption, el("thead", {}, [el("tr", {}, heads)]), rows])]);
  const accept = button("Accept", () => fit.accept(), { attributes: { title: "Apply to the plan" } });
  const reject = button("Reject", () => fit.reject(), { attributes: { title: "Discard" } });
  const show = () => {
    const { response, milliseconds } = fit.fitted.value ?? { response: null, milliseconds: 0 };
    box.hidden = !fit.isActive;
    accept.disabled = !fit.isSettled;
    details.hidden = response === null;
    const lines = response === null ? [] : targetSentences(response, fit.targets.value, bench.plan.handles, fit.limitShare);
    if (fit.problem.value !== null) lines.unshift(`Not reachable: ${messageOf(fit.problem.value)}`);
    else if (!fit.isAsked) lines.unshift("This is the planned face: drag a target, or type its position.");
    else if (response === null) lines.unshift("The server is preparing answers for these points …");
    else lines.push(`Searched for ${Math.max(1, Math.round(1000 * response.searchSeconds))} ms, answered after ${Math.max(1, Math.round(milliseconds))}; bone moves ${formatNumber(response.movementMm)} mm from rest.`);
    status.replaceChildren(...lines.map((text) => el("p", { text })));
    rows.replaceChildren(...(response?.numbers ?? []).map((number) => numberRow(bench, number)));
  };
  const box = el("div", { class: "target-answer", attributes: { role: "group", "aria-label": "Result for the targets" } }, [status, details, el("div", { class: "buttons" }, [accept, reject])]);
  fit.targets.watch(show);
  fit.fitted.watch(show);
  fit.problem.watch(show);
  fit.isAsking.watch(() => (accept.disabled = !fit.isSettled));
  return box;
}

function numberRow(bench: Workbench, number: FittedNumber): HTMLElement {
  const degrees = 180 / Math.PI;
  const unit = number.isRotation ? "°" : "mm";
  const scale = number.isRotation ? degrees : 1;
  const isHeld = number.bound !== FitBound.UNSPECIFIED;
  return el("tr", {}, [
    el("th", { text: `${numberName(number, bench.plan.handles)}, ${unit}`, attributes: { scope: "row" } }),
    el("td", { text: formatNumber(scale * number.value) }),
    el("td", { text: isHeld ? "held by its limit" : `${formatNumber(100 * number.byTargets, 0)} %` }),
    el("td", { text: isHeld ? "" : formatNumber(scale * number.errorPerMm) }),
  ]);
}
