// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { messageOf } from "../calls/call_error";
import type { Gateway } from "../calls/gateway";
import { download } from "../exports/files";
import { type PlanBuild, PlanBuildState } from "../generated/tissueform/v1/plan_build_service_pb";
import { randomId } from "../live/session_opening";
import { button, el, newId, section, whileBusy } from "../panels/dom";
import { formatBytes } from "../planning/numbers";
import type { LabelMap, Volume } from "../volume/volume";
import { type BuildReport, cautionsBox, parseReport, reportBox } from "./build_report";
import { buildList, stateText } from "./build_list";
import { beginBuild, discardBuild, isDone, readBuiltFile, watchBuild } from "./build_run";
import type { PlanDraft } from "./plan_draft";
import { hasPoint, parseRecipe, recipeText, roundedPlane, withSegment } from "./recipe";
import { type Step, problemBox } from "./step";

/** Writers of files, which are fetched when the first is sent. */
export interface CtWriters {
  nrrdOf(volume: Volume, onProgress: (share: number) => void): Promise<Blob>;
  nrrdOfLabels(labels: LabelMap): Promise<Blob>;
}

/** A build that the page begins or follows. */
interface Run {
  readonly ending: AbortController;
  /** Empty until the server has begun it. */
  name: string;
  isCancelled?: boolean;
}

/** Sends CT and recipe, follows the build, shows what it reports. Builds of before are in a list: a page that comes back goes on. */
export function buildStep(gateway: Gateway, draft: PlanDraft, load: () => Promise<CtWriters>, onCase: (caseName: string) => void, proposedTitle = ""): Step {
  const problem = problemBox();
  const titleId = newId("title");
  const title = el("input", { id: titleId, attributes: { type: "text", autocomplete: "off", maxlength: "200" } });
  title.value = proposedTitle;
  const status = el("p", { class: "told", attributes: { role: "status" } });
  const progress = el("progress", { attributes: { max: "1", "aria-label": "Progress" } });
  const result = el("div", { class: "result" });
  let running: Run | null = null;

  const run = async (begin: (ending: AbortController) => Promise<PlanBuild>) => {
    if (running?.name === "") return problem.show("A CT is being sent: wait, or cancel it first.");
    // Another one that is followed goes on on the server.
    running?.ending.abort(new Error("replaced"));
    const own: Run = (running = { ending: new AbortController(), name: "" });
    const isShown = () => running === own && !own.ending.signal.aborted;
    const showBuild = (build: PlanBuild) => {
      builds.show(build);
      if (!isShown()) return;
      status.textContent = stateText(build);
      progress.value = build.fraction;
    };
    problem.show("");
    result.replaceChildren();
    setRunning(true);
    try {
      const begun = await begin(own.ending);
      own.name = begun.name;
      if (own.isCancelled) return await discardBuild(gateway, begun.name);
      showBuild(begun);
      const build = isDone(begun) ? begun : await watchBuild(gateway, begun.name, showBuild, own.ending.signal);
      if (!isShown()) return;
      status.textContent = stateText(build);
      if (build.state === PlanBuildState.SUCCEEDED) await showResult(build);
      else problem.show(build.detail === "" ? "" : messageOf(build.detail));
    } catch (thrown) {
      if (!isShown()) return;
      status.textContent = "";
      problem.show(messageOf(thrown));
    } finally {
      if (running === own) {
        running = null;
        setRunning(false);
      }
      void builds.refresh();
    }
  };
  const builds = buildList(gateway, (build) => void run(() => Promise.resolve(build)), problem.show);
  // With the file's own values, which the recipe explains, on the grid that lies in the patient as the slices show it.
  const packedCt = async (onProgress: (share: number) => void) => {
    const { source, shown } = draft;
    if (source === null || shown === null) throw new Error("there is no CT yet: drop one in the first step");
    return (await load()).nrrdOf({ ...source, grid: shown.grid }, onProgress);
  };
  const start = button("Build the plan", () =>
    void run(async ({ signal }) => {
      parseRecipe(recipeText(draft.recipe));
      status.textContent = "Packing the CT";
      const ct = draft.received === null ? await packedCt((share) => (progress.value = share)) : { draft: draft.received };
      const ofLabels = draft.labels === null ? null : await (await load()).nrrdOfLabels(draft.labels);
      signal.throwIfAborted();
      const input = { recipeText: recipeText(draft.recipe), ct, labels: ofLabels, title: title.value, requestId: randomId() };
      return beginBuild(gateway, input, (share) => {
        status.textContent = "Sending the CT";
        progress.value = share;
      }, signal);
    }), { class: "primary" });
  const keep = button("Download the CT as it is sent", () =>
    void whileBusy(keep, async () => download("ct.nrrd", await packedCt(() => {})), (thrown) => problem.show(messageOf(thrown))));
  const cancel = button("Cancel", () => {
    if (running === null) return;
    const { ending, name } = running;
    running.isCancelled = true;
    ending.abort(new Error("canceled"));
    status.textContent = "The build was canceled.";
    if (name !== "") void discardBuild(gateway, name).catch((thrown) => problem.show(messageOf(thrown))).then(builds.refresh);
  });
  const setRunning = (isRunning: boolean) => {
    // The button that was pressed goes away: the keyboard goes on at the other.
    const hadFocus = [start, cancel].includes(document.activeElement as HTMLButtonElement);
    cancel.hidden = !isRunning;
    progress.hidden = !isRunning;
    update();
    if (hadFocus) (isRunning ? cancel : start).focus();
  };
  const showResult = async (build: PlanBuild) => {
    const report = parseReport(await readBuiltFile(gateway, build.name, "report.json"));
    result.replaceChildren(resultBox(gateway, build, report, draft, onCase));
  };
  const update = () => {
    start.disabled = running !== null || draft.source === null || draft.recipe.segments.length === 0;
    keep.disabled = draft.source === null;
  };
  setRunning(false);
  void builds.refresh();
  const element = el("div", {}, [
    section("Build", [
      el("div", { class: "field" }, [el("label", { text: "Title of the case", attributes: { for: titleId } }), title]),
      el("p", { class: "quiet", text: "Others who may open the case read the title: do not write the patient's name." }),
      el("div", { class: "buttons" }, [start, cancel, keep]),
      status,
      progress,
      problem.element,
    ]),
    result,
    builds.element,
  ]);
  return { title: "Build", element, needsCt: false, update };
}

/** The report and the way on: a plan that is not ready opens once its cautions were opened and confirmed. */
function resultBox(gateway: Gateway, build: PlanBuild, report: BuildReport, draft: PlanDraft, onCase: (caseName: string) => void): HTMLElement {
  const open = button("Open the planner", () => onCase(build.case), { class: "primary" });
  const readId = newId("read");
  const read = el("input", { id: readId, attributes: { type: "checkbox" }, on: { change: () => (open.disabled = !read.checked) } });
  read.disabled = true;
  const confirm = el("div", { class: "check" }, [read, el("label", { text: "I have read this", attributes: { for: readId } })]);
  const cautions = cautionsBox(report, () => (read.disabled = false));
  const mustRead = !build.isReady;
  open.disabled = mustRead;
  const problem = problemBox();
  const useFound = button("Edit the planes that the build found", () =>
    void whileBusy(useFound, async () => draft.change(withFound(draft, report)), (thrown) => problem.show(messageOf(thrown))));
  const pictureOf = async (file: string) => URL.createObjectURL(new Blob([await readBuiltFile(gateway, build.name, file)], { type: "image/png" }));
  return el("div", {}, [
    section("Result", [
      ...(mustRead ? [el("p", { class: "warning", text: `Not ready: ${messageOf(build.defects)} Open the cautions and confirm that you have read them.` })] : []),
      ...(mustRead ? [confirm] : []),
      el("div", { class: "buttons" }, [open, useFound]),
      problem.element,
    ]),
    reportBox(report, mustRead ? defectsBefore(build, cautions) : cautions, pictureOf),
    filesBox(gateway, build),
  ]);
}

/** All that was made, to keep. */
function filesBox(gateway: Gateway, build: PlanBuild): HTMLElement {
  const problem = problemBox();
  const items = build.files.map(({ path, totalBytes }) => {
    const keep: HTMLButtonElement = button(path, () =>
      void whileBusy(keep, async () => download(path.replace(/.*\//, ""), new Blob([await readBuiltFile(gateway, build.name, path)])), (thrown) => problem.show(messageOf(thrown))));
    return el("li", {}, [keep, el("small", { text: formatBytes(Number(totalBytes)) })]);
  });
  return section("Files", [problem.element, el("ul", { class: "notes files" }, items)]);
}

/** What is missed is among what has to be read. */
function defectsBefore(build: PlanBuild, cautions: HTMLDetailsElement): HTMLElement {
  cautions.querySelector("ul")?.prepend(el("li", { text: messageOf(build.defects) }));
  return cautions;
}

/** The recipe with the planes of a report, so that they can be dragged; those that were set stay. */
export function withFound(draft: Pick<PlanDraft, "recipe">, report: BuildReport): PlanDraft["recipe"] {
  let { recipe } = draft;
  for (const [index, { name, planes }] of recipe.segments.entries()) {
    const found = report.segments.find((segment) => segment.name === name)?.planes;
    if (planes === undefined && found !== undefined) recipe = withSegment(recipe, index, { planes: found.map(roundedPlane) });
  }
  const occlusal = report.landmarks.occlusal_plane as { point_mm: [number, number, number]; normal: [number, number, number] } | undefined;
  if (recipe.occlusal_plane === undefined && hasPoint(occlusal)) recipe = { ...recipe, occlusal_plane: roundedPlane(occlusal) };
  return recipe;
}
