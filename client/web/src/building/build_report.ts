// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { el, section } from "../panels/dom";

// What a build reports (docs/recipe-format.md, "report.json"), for people: texts of the server, shown as texts.

interface Requirement {
  requirement: string;
  required: string;
  measured: string;
  passed: boolean;
}

interface ReportPicture {
  file: string;
  title: string;
  caption: string;
}

/** The part of report.json that the page shows. */
export interface BuildReport {
  ready: boolean;
  /** `surfaces`: by their roles, of a plan that is from surfaces and not from a CT. */
  input: { surfaces?: unknown };
  quality: Requirement[];
  cautions: string[];
  segments: { name: string; planes?: { point_mm: [number, number, number]; normal: [number, number, number] }[] }[];
  landmarks: Record<string, unknown>;
  metal: { found?: boolean; corrected_slices?: number };
  coverage: { whole?: { covered_share?: number } };
  pictures: ReportPicture[];
}

/** Throws an Error with one sentence where it is not a report. */
export function parseReport(bytes: Uint8Array): BuildReport {
  const json = JSON.parse(new TextDecoder().decode(bytes)) as Partial<BuildReport>;
  const lists = [json.quality, json.cautions, json.segments];
  if (!lists.every(Array.isArray) || typeof json.ready !== "boolean") throw new Error("the server's report.json is not a report: server and page have different versions");
  return { input: {}, landmarks: {}, metal: {}, coverage: {}, pictures: [], ...json } as BuildReport;
}

/** One line for each finding that people ask for first. */
export function factsOf(report: BuildReport): string[] {
  const share = report.coverage.whole?.covered_share;
  const { surfaces } = report.input;
  const isFromSurfaces = Array.isArray(surfaces);
  const source = isFromSurfaces ? [`Built from surfaces, without a CT: ${surfaces.join(", ")}.`] : [];
  const skin = share === undefined ? [] : [`The model has ${(100 * share).toFixed(1)} % of the ${isFromSurfaces ? "given" : "CT's"} skin.`];
  return [...source, ...skin, ...(isFromSurfaces ? [] : [metalFact(report)]), ...report.segments.map(segmentFact)];
}

function metalFact({ metal: { found, corrected_slices: slices = 0 } }: BuildReport): string {
  return found === true ? `Metal artifacts were reduced in ${slices} slices.` : "No metal was found.";
}

function segmentFact({ name, planes = [] }: BuildReport["segments"][number]): string {
  if (planes.length === 0) return `${name} was given as a surface.`;
  return `${name} was cut by ${planes.length} ${planes.length === 1 ? "plane" : "planes"}.`;
}

/** Cautions, in a part that is opened; `onOpen` is called when it is first. */
export function cautionsBox(report: BuildReport, onOpen: () => void): HTMLDetailsElement {
  const items = report.cautions.map((text) => el("li", { text }));
  const title = report.cautions.length === 1 ? "1 caution" : `${report.cautions.length} cautions`;
  const box = el("details", { class: "cautions" }, [el("summary", { text: title }), el("ul", { class: "notes" }, items)]);
  box.addEventListener("toggle", () => box.open && onOpen());
  return box;
}

/** `pictureOf`: the address of a picture; rejects if it cannot be fetched. */
export function reportBox(report: BuildReport, cautions: HTMLElement, pictureOf: (file: string) => Promise<string>): HTMLElement {
  const failed = report.quality.filter(({ passed }) => !passed);
  const rows = [...failed, ...report.quality.filter(({ passed }) => passed)].map(({ requirement, required, measured, passed }) =>
    el("tr", { class: passed ? "" : "missed" }, [el("th", { text: requirement, attributes: { scope: "row" } }), el("td", { text: required }), el("td", { text: measured }), el("td", { text: passed ? "met" : "missed" })]),
  );
  const head = el("thead", {}, [el("tr", {}, ["Requirement", "Required", "Measured", ""].map((text) => el("th", { text, attributes: { scope: "col" } })))]);
  const table = el("div", { class: "wide", attributes: { tabindex: "0", role: "region", "aria-label": "Requirements" } }, [el("table", {}, [head, el("tbody", {}, rows)])]);
  return section("Report", [
    el("ul", { class: "notes" }, factsOf(report).map((text) => el("li", { text }))),
    cautions,
    el("details", {}, [el("summary", { text: "Requirements" }), table]),
    el("div", { class: "report-pictures" }, report.pictures.map((picture) => pictureFigure(picture, pictureOf))),
  ]);
}

function pictureFigure({ file, title, caption }: ReportPicture, pictureOf: (file: string) => Promise<string>): HTMLElement {
  const image = el("img", { attributes: { alt: title } });
  const text = el("figcaption", {}, [el("strong", { text: title }), el("span", { text: caption })]);
  void pictureOf(file).then(
    (address) => (image.src = address),
    () => image.replaceWith(el("p", { class: "warning", text: "This picture cannot be fetched." })),
  );
  return el("figure", {}, [image, text]);
}
