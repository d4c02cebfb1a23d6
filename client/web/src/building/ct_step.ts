// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { messageOf } from "../calls/call_error";
import { button, el, newId, section } from "../panels/dom";
import type { LabelMap } from "../volume/volume";
import type { DroppedFile, OpenedCt, SeriesEntry } from "../volume/opened_ct";
import { droppedFiles, filesOf } from "../volume/dropped_files";
import { areAxes } from "./file_axes";
import type { PlanDraft } from "./plan_draft";
import { withValue } from "./recipe";
import { type Step, numberField, problemBox } from "./step";

/** Readers of files, which are fetched when the first is dropped. */
export interface CtReaders {
  openCt(files: readonly DroppedFile[], onProgress: (share: number) => void, signal?: AbortSignal): Promise<OpenedCt>;
  openLabels(file: File): Promise<LabelMap>;
}

/** A CT that waits on the server. */
export interface ReceivedCt {
  readonly name: string;
  readonly title: string;
  read(onProgress: (share: number) => void): Promise<DroppedFile[]>;
}

/** Files become a volume: a folder, a zip or a volume, of which one series is chosen; and a label map, or none. `received` is read at once. */
export function ctStep(draft: PlanDraft, load: () => Promise<CtReaders>, onVolume: () => void, received: ReceivedCt | null = null): Step {
  const origin = el("p", { class: "quiet" });
  const status = el("p", { class: "told", attributes: { role: "status" } });
  const problem = problemBox();
  const progress = el("progress", { attributes: { max: "1", "aria-label": "Progress" } });
  progress.hidden = true;
  const seriesList = el("div", { class: "series", attributes: { role: "radiogroup", "aria-label": "Series" } });
  const notes = el("ul", { class: "notes" });
  let opened: OpenedCt | null = null;
  let reading = new AbortController();
  let labels: LabelMap | null = null;
  // Of the files that are open.
  let source: string | null = null;

  const working = async (text: string, run: (signal: AbortSignal, onProgress: (share: number) => void) => Promise<void>) => {
    reading.abort(new Error("replaced"));
    const own = (reading = new AbortController());
    problem.show("");
    status.textContent = text;
    progress.hidden = false;
    try {
      await run(own.signal, (share) => (progress.value = share));
      if (own === reading) status.textContent = "";
    } catch (thrown) {
      if (own !== reading) return;
      status.textContent = "";
      problem.show(messageOf(thrown));
    } finally {
      if (own === reading) progress.hidden = true;
    }
  };
  const takeSeries = (id: string) =>
    working("Reading the slices", async (signal, onProgress) => {
      const volume = await (opened as OpenedCt).read(id, onProgress, signal);
      signal.throwIfAborted();
      draft.setVolume(volume, labels, source);
      onVolume();
    });
  const takeFiles = (files: (onProgress: (share: number) => void) => Promise<DroppedFile[]>, from: string | null = null) =>
    working(from === null ? "Opening the files" : "Loading the CT from the server", async (signal, onProgress) => {
      const all = await files(onProgress);
      signal.throwIfAborted();
      if (all.length === 0) throw new Error("nothing was dropped: drop a DICOM folder, a zip, or an NRRD, NIfTI or MetaImage file");
      const next = await (await load()).openCt(all, onProgress, signal);
      signal.throwIfAborted();
      opened?.close();
      opened = next;
      source = from;
      notes.replaceChildren(...next.notes.map((text) => el("li", { text })));
      seriesList.replaceChildren(...next.series.map((entry) => seriesEntry(entry, entry.id === next.proposed, () => void takeSeries(entry.id))));
      if (next.proposed === null) throw new Error("none of the series can be used: see the reasons in the list");
      void takeSeries(next.proposed);
    });
  const takeLabels = (file: File) =>
    working("Reading the label map", async (signal) => {
      labels = await (await load()).openLabels(file);
      signal.throwIfAborted();
      if (draft.source !== null) draft.setVolume(draft.source, labels, draft.received);
    });
  const values = valuesFields(draft);
  const element = section("CT", [
    origin,
    dropZone((files) => void takeFiles(() => files)),
    status,
    progress,
    problem.element,
    seriesList,
    notes,
    labelsField((file) => void takeLabels(file)),
    values.element,
    el("p", { class: "quiet", text: "Files are read in this browser. Names, dates and identifiers of the patient stay here; only voxel values, their geometry and the recipe are sent when you build." }),
  ]);
  const update = () => {
    origin.hidden = received === null;
    origin.textContent = originText(received, draft);
    values.update();
  };
  if (received !== null) void takeFiles(received.read, received.name);
  return { title: "CT", element, needsCt: false, update };
}

function originText(received: ReceivedCt | null, { source, received: name }: PlanDraft): string {
  if (received === null) return "";
  const title = received.title === "" ? "The received CT" : received.title;
  return source !== null && name === null
    ? `${title} was replaced by your files. Predictions of this plan cannot be sent to its study in the PACS.`
    : `${title}, received from the PACS. Files that you drop here replace it.`;
}

function seriesEntry(entry: SeriesEntry, isChosen: boolean, onChoose: () => void): HTMLElement {
  const id = newId("series");
  const input = el("input", { id, attributes: { type: "radio", name: "series" }, on: { change: onChoose } });
  input.checked = isChosen;
  input.disabled = entry.objections.length > 0;
  const { size, slices, pixelSpacing, sliceSpacing } = entry;
  const facts = [`${size[0]} × ${size[1]} × ${slices}`, `${pixelSpacing.toFixed(2)} × ${sliceSpacing.toFixed(2)} mm`, entry.kernel].filter((fact) => fact !== "").join(" · ");
  const title = [entry.modality, entry.description].filter((text) => text !== "").join(" ");
  const label = el("label", { attributes: { for: id } }, [el("strong", { text: title === "" ? "Volume" : title }), el("small", { text: facts })]);
  return el("div", { class: "one-series" }, [input, label, ...entry.objections.map((text) => el("p", { class: "warning", text }))]);
}

function dropZone(onFiles: (files: Promise<DroppedFile[]>) => void): HTMLElement {
  const [fileId, folderId] = [newId("ct"), newId("folder")];
  const input = (id: string, attributes: Record<string, string>) => {
    const field = el("input", { id, attributes: { type: "file", ...attributes } });
    field.addEventListener("change", () => {
      onFiles(Promise.resolve(filesOf(field.files)));
      field.value = "";
    });
    return field;
  };
  const zone = el("div", { class: "drop" }, [
    el("p", { text: "Drop a DICOM folder, a zip or a volume (NRRD, NIfTI, MetaImage) here" }),
    el("label", { text: "Choose a folder", attributes: { for: folderId } }),
    input(folderId, { webkitdirectory: "" }),
    el("label", { text: "Choose files", attributes: { for: fileId } }),
    input(fileId, { multiple: "" }),
  ]);
  const mark = (isOver: boolean) => (event: DragEvent) => {
    event.preventDefault();
    zone.classList.toggle("over", isOver);
  };
  zone.addEventListener("dragover", mark(true));
  zone.addEventListener("dragleave", mark(false));
  zone.addEventListener("drop", (event) => {
    mark(false)(event);
    if (event.dataTransfer !== null) onFiles(droppedFiles(event.dataTransfer));
  });
  return zone;
}

function labelsField(onFile: (file: File) => void): HTMLElement {
  const id = newId("labels");
  const field = el("input", { id, attributes: { type: "file", accept: ".nrrd,.nii,.gz,.mha" } });
  field.addEventListener("change", () => {
    const file = field.files?.[0];
    if (file !== undefined) onFile(file);
  });
  return el("div", { class: "file-field" }, [el("label", { text: "Label map of this CT (optional)", attributes: { for: id } }), field]);
}

/** What the files of a CT may not say: the recipe's "ct". */
function valuesFields(draft: PlanDraft): { element: HTMLElement; update(): void } {
  const offset = numberField("Add to values to get HU", "mm", (value) => draft.change(withValue(draft.recipe, ["ct", "hu_offset"], value === 0 ? undefined : value)), 0);
  offset.element.querySelector(".unit")?.remove();
  const id = newId("axes");
  const axes = el("input", { id, attributes: { type: "text", maxlength: "3", placeholder: "from the file", autocomplete: "off" } });
  axes.addEventListener("change", () => {
    const text = axes.value.trim().toUpperCase();
    const isValid = text === "" || areAxes(text);
    axes.setAttribute("aria-invalid", String(!isValid));
    if (isValid) draft.change(withValue(draft.recipe, ["ct", "axes"], text === "" ? undefined : text));
  });
  const element = el("details", {}, [
    el("summary", { text: "What the file does not say" }),
    el("div", { class: "rows" }, [
      offset.element,
      el("div", { class: "number" }, [el("label", { text: "Axes of the file (L R A P S I)", attributes: { for: id } }), axes]),
      button("As the file says", () => draft.change(withValue(withValue(draft.recipe, ["ct", "hu_offset"], undefined), ["ct", "axes"], undefined))),
    ]),
  ]);
  return {
    element,
    update() {
      offset.set(draft.recipe.ct?.hu_offset ?? 0);
      if (document.activeElement !== axes) axes.value = draft.recipe.ct?.axes ?? "";
    },
  };
}
