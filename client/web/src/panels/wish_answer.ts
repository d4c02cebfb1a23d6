// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { sentenceOf } from "../calls/call_error";
import { FitBound, type FitResponse, type FittedNumber } from "../generated/tissueform/v1/plan_service_pb";
import { formatNumber } from "../planning/numbers";
import type { Workbench } from "../workbench/workbench";
import { button, collapsible, el } from "./dom";

/** What becomes of the wishes: reached or missed, what holds back, how well each number is told; and to accept or reject it. */
export function wishAnswer(bench: Workbench): HTMLElement {
  const fit = bench.wishes;
  const told = el("div", { class: "wish-told", attributes: { role: "status" } });
  const rows = el("tbody");
  const heads = ["Number", "Value", "Told by wishes", "Per mm"].map((text) => el("th", { text, attributes: { scope: "col" } }));
  const caption = el("caption", { text: "Axes of the scanner. What the wishes do not tell is moved least; per mm: by how much it would differ were all wishes off by 1 mm." });
  const details = collapsible("How well each number is told", [el("table", {}, [caption, el("thead", {}, [el("tr", {}, heads)]), rows])]);
  const accept = button("Accept", () => fit.accept(), { attributes: { title: "Into the plan, as one step" } });
  const reject = button("Reject", () => fit.reject(), { attributes: { title: "The plan as it was" } });
  const show = () => {
    const { response, milliseconds } = fit.fitted.value ?? { response: null, milliseconds: 0 };
    box.hidden = !fit.isActive;
    accept.disabled = response === null || fit.problem.value !== null;
    details.hidden = response === null;
    const lines = sentences(bench, response);
    if (fit.problem.value !== null) lines.unshift(`This cannot be asked: ${sentenceOf(fit.problem.value)}`);
    else if (response === null) lines.unshift("The server prepares answers for these points …");
    else lines.push(`Searched for ${Math.max(1, Math.round(1000 * response.searchSeconds))} ms, answered after ${Math.max(1, Math.round(milliseconds))}; bone moves ${formatNumber(response.movementMm)} mm from rest.`);
    told.replaceChildren(...lines.map((text) => el("p", { text })));
    rows.replaceChildren(...(response?.numbers ?? []).map((number) => numberRow(bench, number)));
  };
  const box = el("div", { class: "wish-answer", attributes: { role: "group", "aria-label": "Answer to the wishes" } }, [told, details, el("div", { class: "buttons" }, [accept, reject])]);
  fit.wishes.watch(show);
  fit.fitted.watch(show);
  fit.problem.watch(show);
  return box;
}

function sentences(bench: Workbench, response: FitResponse | null): string[] {
  if (response === null) return [];
  const { wishes } = bench.wishes;
  const label = (name: string) => wishes.value[Number(name.replace("wish ", "")) - 1]?.label ?? name;
  const held = response.numbers.filter(({ bound }) => bound !== FitBound.UNSPECIFIED);
  return [
    ...response.targets.map(({ name, reached, missedMm }) => {
      if (reached) return `${label(name)}: reached, within ${formatNumber(Math.max(missedMm, 0.01), 2)} mm.`;
      return `${label(name)}: cannot be reached; ${formatNumber(missedMm)} mm are missing.`;
    }),
    ...response.contradictions.map(({ first, second }) => `${label(first)} and ${label(second)} ask different things of the same bone.`),
    ...(held.length === 0 ? [] : [`Held by its limit: ${held.map((number) => numberName(bench, number)).join(", ")}.`]),
    ...(response.converged ? [] : ["The search has not come to its end; wish for less."]),
  ];
}

const SHIFTS = ["to the left", "to the back", "up"];
const TURNS = ["about left", "about back", "about up"];

function numberName(bench: Workbench, { handle, isRotation, axis }: FittedNumber): string {
  const label = bench.plan.handles.find(({ name }) => name === handle)?.label ?? handle;
  return `${label} ${(isRotation ? TURNS : SHIFTS)[axis] ?? ""}`;
}

function numberRow(bench: Workbench, number: FittedNumber): HTMLElement {
  const degrees = 180 / Math.PI;
  const unit = number.isRotation ? "°" : "mm";
  const scale = number.isRotation ? degrees : 1;
  const isHeld = number.bound !== FitBound.UNSPECIFIED;
  return el("tr", {}, [
    el("th", { text: `${numberName(bench, number)}, ${unit}`, attributes: { scope: "row" } }),
    el("td", { text: formatNumber(scale * number.value) }),
    el("td", { text: isHeld ? "held by its limit" : `${formatNumber(100 * number.byTargets, 0)} %` }),
    el("td", { text: isHeld ? "" : formatNumber(scale * number.errorPerMm) }),
  ]);
}
