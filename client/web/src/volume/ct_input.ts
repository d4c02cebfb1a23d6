// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { dot } from "../geometry/rotation";
import { readDicomHeaders } from "./dicom_file";
import { describeKind, normalOf, type DicomHeader } from "./dicom_header";
import { syntaxObjection } from "./dicom_pixels";
import { partsOf, pixelReaders, type PixelReader } from "./pixel_readers";
import type { DroppedFile, OpenedCt, SeriesEntry } from "./opened_ct";
import { factsOf, upperMedian } from "./series_facts";
import { otherModality, pickSeries } from "./series_rules";
import { separateAcquisitions } from "./slice_acquisitions";
import { byNumber, joinGroups, type SliceGroup } from "./slice_groups";
import { areAlike, arrangeStack, LEAST_SLICES, ON_COMMAND_LINE, type SliceStack } from "./slice_stack";
import type { Volume } from "./volume";
import { isVolumeFile, openVolumeFile } from "./volume_file";
import { filesOfZip } from "./zip_files";

// Everything that openCt does, on the calling thread: the worker's part.

const MAX_FILES = 20_000;
const ZIP = /\.zip$/i;

interface Group {
  readonly id: string;
  readonly objects: readonly DicomHeader[];
  /** The CT slices alone. */
  readonly slices: readonly DicomHeader[];
  readonly stack: SliceStack | null;
  readonly objections: readonly string[];
  /** What else is to be known of it. */
  readonly notes: readonly string[];
}

interface Listing {
  readonly headers: DicomHeader[];
  readonly others: number;
}

const plural = (count: number, what: string) => `${count} ${what}${count === 1 ? "" : "s"}`;

async function readHeaders(files: readonly DroppedFile[], numberOf: ReadonlyMap<DroppedFile, number>, onFile: () => void, signal?: AbortSignal): Promise<Listing> {
  const headers: DicomHeader[] = [];
  let others = 0;
  for (const dropped of files) {
    signal?.throwIfAborted();
    const images = await readDicomHeaders(dropped.file, numberOf.get(dropped)!);
    if (images.length === 0) others += 1;
    for (const image of images) headers.push(image);
    onFile();
  }
  return { headers, others };
}

/** How many folders all files have in common. */
function commonDepth(files: readonly DroppedFile[]): number {
  const folders = files.map(({ path }) => path.split("/").slice(0, -1));
  let depth = 0;
  while (folders.every((folder) => folder.length > depth && folder[depth] === folders[0][depth])) depth += 1;
  return depth;
}

/** A folder with CT images is read without the folders below it; without, all below it are. */
async function listFolder(files: readonly DroppedFile[], onProgress: (share: number) => void, signal?: AbortSignal): Promise<Listing> {
  const sorted = [...files].sort((a, b) => (a.path < b.path ? -1 : a.path > b.path ? 1 : 0));
  const numberOf = new Map(sorted.map((file, i) => [file, i + 1]));
  let read = 0;
  const onFile = () => onProgress(++read / sorted.length);
  const depth = commonDepth(sorted);
  const isDirect = ({ path }: DroppedFile) => path.split("/").length === depth + 1;
  const direct = await readHeaders(sorted.filter(isDirect), numberOf, onFile, signal);
  if (direct.headers.some(({ kind }) => kind === "ct slice" || kind === "multi-frame")) return direct;
  const below = await readHeaders(sorted.filter((file) => !isDirect(file)), numberOf, onFile, signal);
  const headers = [...direct.headers, ...below.headers].sort((a, b) => a.fileNumber - b.fileNumber);
  return { headers, others: direct.others + below.others };
}

async function haveSameBytes(a: Blob, b: Blob): Promise<boolean> {
  if (a.size !== b.size) return false;
  const [left, right] = [new Uint8Array(await a.arrayBuffer()), new Uint8Array(await b.arrayBuffer())];
  return left.every((byte, i) => byte === right[i]);
}

/** Files whose bytes are those of another, as folders hold them that were merged, by their numbers. Only files of one series and place are compared. */
async function copiesIn(headers: readonly DicomHeader[]): Promise<Set<number>> {
  const seen = new Map<string, DicomHeader[]>();
  const copies = new Set<number>();
  for (const header of headers.filter(({ frame }) => frame === 0)) {
    const place = JSON.stringify([header.seriesUid, header.instanceNumber, header.position]);
    const known = seen.get(place) ?? [];
    let isCopy = false;
    for (const other of header.kind === "ct slice" ? known : []) isCopy ||= await haveSameBytes(other.file, header.file);
    if (isCopy) copies.add(header.fileNumber);
    else seen.set(place, [...known, header]);
  }
  return copies;
}

function groupBySeries(headers: readonly DicomHeader[]): SliceGroup[] {
  const groups = new Map<string, DicomHeader[]>();
  for (const header of headers) {
    if (header.kind === "directory") continue;
    const key = JSON.stringify([header.patient, header.seriesUid, header.seriesNumber]);
    const objects = groups.get(key) ?? [];
    groups.set(key, objects);
    objects.push(header);
  }
  return [...groups.values()].map((objects) => ({ objects, series: 1 })).sort(byNumber);
}

const isSlice = ({ kind }: DicomHeader) => kind === "ct slice";
/** What may be slices that are not read: the stack would lack them. */
const mayBeSlice = ({ kind }: DicomHeader) => kind === "multi-frame" || kind === "damaged";

interface Candidate extends SliceGroup {
  readonly notes: readonly string[];
}

/** Of a group that is two whole scans each is one; a smaller scan among its slices is left out. */
function scansOf({ objects, series }: SliceGroup): Candidate[] {
  if (!objects.every(isSlice)) return [{ objects, series, notes: [] }];
  const [first, ...others] = separateAcquisitions(objects);
  const isEnough = ({ slices }: { slices: readonly DicomHeader[] }) => slices.length >= Math.max(LEAST_SLICES, Math.floor(first.slices.length / 2));
  const notes = series > 1 ? [`${first.slices.length} slices of ${series} series are read as one: they are of one patient, size and orientation, and their places fit.`] : [];
  for (const { slices, basis } of others.filter((other) => !isEnough(other))) {
    notes.push(`Left out: ${plural(slices.length, "slice")} of another scan among the others (told apart by ${basis}).`);
  }
  if (first.slices[0].hasEvenFrames) notes.push("The file has no position for each frame: its frames are placed by SpacingBetweenSlices. Check that the head is not upside down.");
  return [{ objects: first.slices, series, notes }, ...others.filter(isEnough).map(({ slices }) => ({ objects: slices, series: 1, notes: [] }))];
}

/** What may be one CT each, and the other series. */
function candidatesOf(headers: readonly DicomHeader[]): Candidate[] {
  const groups = groupBySeries(headers);
  const ofCt = groups.filter(({ objects }) => objects.some(isSlice));
  const others = groups.filter((group) => !ofCt.includes(group)).map((group) => ({ ...group, notes: [] }));
  const strangers: string[] = [];
  const slicesAlone = ofCt.map(({ objects, series }) => {
    const kept = objects.filter((object) => isSlice(object) || mayBeSlice(object));
    const left = objects.length - kept.length;
    if (left > 0) strangers.push(`Left out of ${keyOf(objects)}: ${plural(left, "object")} that ${left === 1 ? "is not a CT slice" : "are not CT slices"}.`);
    return { objects: kept, series };
  });
  const scans = joinGroups(slicesAlone).flatMap(scansOf);
  return [...scans, ...others].sort(byNumber).map((candidate, index) => (index === 0 ? { ...candidate, notes: [...strangers, ...candidate.notes] } : candidate));
}

const messageOf = (error: unknown) => (error instanceof Error ? error.message : String(error));

/** Why a series without CT slices is not a CT. */
function objectionToKind(first: DicomHeader): string {
  if (first.kind === "other modality" && first.modality !== "CT") return otherModality(first.modality);
  if (first.kind === "multi-frame") return "its files hold several frames each, without positions: export it as single slices";
  return `it is ${describeKind(first)}, not a CT; choose another series`;
}

function unreadSlices(objects: readonly DicomHeader[]): string[] {
  const unread = objects.find(mayBeSlice);
  return unread === undefined ? [] : [`file ${unread.fileNumber} of the folder is ${describeKind(unread)}; export the series again, or remove that file`];
}

function groupOf({ objects, notes }: Candidate, index: number): Group {
  const slices = objects.filter(isSlice);
  const group = { id: `${index + 1}`, objects, slices, notes };
  if (slices.length === 0) return { ...group, stack: null, objections: [objectionToKind(objects[0])] };
  const objections = unreadSlices(objects);
  if (slices.some(({ hasBurnedText }) => hasBurnedText)) objections.push("its images have text burned in (BurnedInAnnotation YES), which may name the patient; choose a series without");
  const syntax = slices.map(({ transferSyntax }) => syntaxObjection(transferSyntax)).find((objection) => objection !== "");
  if (syntax !== undefined) objections.push(syntax);
  try {
    return { ...group, stack: arrangeStack(slices), objections };
  } catch (error) {
    return { ...group, stack: null, objections: [...objections, messageOf(error)] };
  }
}

function spacingOf(slices: readonly DicomHeader[]): number {
  const axes = slices[0]?.axes;
  if (!axes) return 0;
  const heights = slices.flatMap(({ position }) => (position === null ? [] : [dot(position, normalOf(axes))])).sort((a, b) => a - b);
  return upperMedian(heights.slice(1).map((height, i) => height - heights[i]));
}

function entryOf({ id, objects, slices, stack, objections }: Group): SeriesEntry {
  const first = slices[0] ?? objects[0];
  const count = slices.length > 0 ? slices.length : objects.length;
  const sliceSpacing = stack?.grid.spacing[2] ?? spacingOf(slices);
  const [betweenRows, betweenColumns] = first.pixelSpacing ?? [0, 0];
  return {
    id, modality: first.modality, kernel: first.kernel, slices: count, size: [first.columns, first.rows], sliceSpacing, pixelSpacing: betweenColumns,
    millimeters: [first.columns * betweenColumns, first.rows * betweenRows, count * sliceSpacing], description: first.description, objections,
  };
}

function keyOf([first]: readonly DicomHeader[]): string {
  return first.seriesNumber === null ? "a series without number" : `series ${first.seriesNumber}`;
}

/** Half a head each, maybe. REQUIRES: both have a stack. */
function mayBeOneScan(a: Group, b: Group): boolean {
  if (a.stack === null || b.stack === null || !areAlike(a.slices[0], b.slices[0])) return false;
  const normal = normalOf(a.slices[0].axes!);
  const [ofA, ofB] = [a, b].map(({ slices }) => slices.map(({ position }) => dot(position!, normal)));
  return Math.max(...ofA) < Math.min(...ofB) || Math.max(...ofB) < Math.min(...ofA);
}

/** Between what the rule must not choose; empty where it may. */
function forbiddenChoice(chosen: Group, candidates: readonly Group[]): string {
  const first = chosen.slices[0];
  if (first.studyUid === "") return "series that name no study";
  if (candidates.some(({ slices }) => slices[0].patient !== first.patient)) return "patients";
  if (candidates.some(({ slices }) => slices[0].studyUid !== first.studyUid)) return "studies";
  if (candidates.some((candidate) => candidate !== chosen && mayBeOneScan(chosen, candidate))) return `parts that may be one scan; ${ON_COMMAND_LINE} can read them as one`;
  return candidates.filter(({ slices }) => slices[0].seriesNumber === first.seriesNumber).length > 1 ? "scans with one series number" : "";
}

interface Proposal {
  readonly id: string | null;
  readonly note: string;
}

/** The series that ChooseSeries of core/imaging/ct takes of the folder. */
function propose(groups: readonly Group[]): Proposal {
  const withCt = groups.filter(({ slices }) => slices.length > 0);
  const whole = withCt.filter(({ slices }) => slices.length >= LEAST_SLICES);
  const candidates = whole.length === 0 && withCt.length === 1 ? withCt : whole;
  if (candidates.length === 0) return { id: null, note: "" };
  if (candidates.length === 1) return { id: candidates[0].objections.length === 0 ? candidates[0].id : null, note: "" };
  if (candidates.some(({ slices }) => slices.some(({ frames }) => frames > 1))) {
    return { id: null, note: `Choose one of ${candidates.length} CT series: the default rule does not judge files of several frames.` };
  }
  const facts = candidates.map(({ slices }) => factsOf(keyOf(slices), slices));
  const { chosen, reasons } = pickSeries(facts);
  const findings = facts.map(({ key }, i) => `${key}: ${reasons[i]}`);
  if (chosen < 0) return { id: null, note: `Of ${candidates.length} CT series the default rule accepts none; choose one: ${findings.join("; ")}.` };
  const forbidden = forbiddenChoice(candidates[chosen], candidates);
  if (forbidden !== "") return { id: null, note: `Choose one of ${candidates.length} CT series: the default rule does not choose between ${forbidden}.` };
  if (candidates[chosen].objections.length > 0) return { id: null, note: `The default rule chooses ${facts[chosen].key}, which cannot be used; choose another series.` };
  return { id: candidates[chosen].id, note: `Chosen of ${candidates.length} CT series of one study: ${findings.splice(chosen, 1)[0]}; not ${findings.join("; ")}.` };
}

/** Of a plane that says SECONDARY or of a copied screen: it may show the patient's name. */
function mayShowText({ imageType }: DicomHeader): boolean {
  return /\bSECONDARY\b|SCREEN SAVE/.test(imageType);
}

function notesOf(groups: readonly Group[], listing: Listing, copies: number, proposal: Proposal): string[] {
  const notes = proposal.note === "" ? [] : [proposal.note];
  if (listing.others > 0) notes.push(`Left out: ${plural(listing.others, "file")} that ${listing.others === 1 ? "is" : "are"} not DICOM.`);
  if (copies > 0) notes.push(`Left out: ${plural(copies, "file")} with the same bytes as another one.`);
  const damaged = listing.headers.filter(({ kind }) => kind === "damaged").length;
  if (damaged > 0) notes.push(`Left out: ${plural(damaged, "truncated or damaged DICOM file")}; where slices are missing, copy the folder again.`);
  for (const group of groups) {
    const key = keyOf(group.objects);
    notes.push(...group.notes);
    if (group.slices.some(mayShowText)) notes.push(`The images of ${key} are derived ones (ImageType SECONDARY): look at the slices for text that names the patient before you send them.`);
    notes.push(...(group.stack?.notes ?? []).map((note) => (groups.length > 1 ? `${key}: ${note}` : note)));
  }
  return notes;
}

async function readStack(stack: SliceStack, kernel: string, onProgress: (share: number) => void, signal?: AbortSignal): Promise<Volume> {
  const [columns, rows, count] = stack.grid.size;
  const values = new Int16Array(columns * rows * count);
  const places = new Map(stack.slices.map((slice, k) => [slice, k]));
  const readers = pixelReaders(stack.slices);
  const waiting = partsOf(stack.slices);
  let done = 0;
  const work = async (reader: PixelReader) => {
    for (let part = waiting.shift(); part !== undefined; part = waiting.shift()) {
      signal?.throwIfAborted();
      const images = await reader.read(part);
      part.forEach((slice, i) => values.set(images[i], columns * rows * (places.get(slice) ?? 0)));
      onProgress((done += part.length) / count);
    }
  };
  try {
    await Promise.all(readers.map(work));
  } finally {
    readers.forEach((reader) => reader.close());
  }
  return { grid: stack.grid, values, kernel };
}

async function openFolder(files: readonly DroppedFile[], onProgress: (share: number) => void, signal?: AbortSignal): Promise<OpenedCt> {
  if (files.length === 0) throw new Error("the folder is empty; drop the folder that holds the CT series");
  if (files.length > MAX_FILES) throw new Error(`the folder holds ${files.length} files; at most ${MAX_FILES} are read: drop the folder of one series`);
  const listing = await listFolder(files, onProgress, signal);
  if (listing.headers.length === 0) throw new Error(`none of the ${files.length} files is a DICOM file; drop the folder of the CT series, or one .zip, .nrrd, .nii, .nii.gz or .mha`);
  const copies = await copiesIn(listing.headers);
  const groups = candidatesOf(listing.headers.filter(({ fileNumber }) => !copies.has(fileNumber))).map(groupOf);
  if (groups.length === 0) throw new Error("the folder holds only a directory of images (DICOMDIR), not the images; copy the whole disc");
  const proposal = propose(groups);
  return {
    series: groups.map(entryOf),
    proposed: proposal.id,
    notes: notesOf(groups, listing, copies.size, proposal),
    read(id, onShare, readSignal) {
      const group = groups.find((candidate) => candidate.id === id);
      if (group === undefined) return Promise.reject(new Error("there is no such series; choose one of the list"));
      if (group.stack === null || group.objections.length > 0) return Promise.reject(new Error(`${keyOf(group.objects)} cannot be used: ${group.objections[0]}`));
      return readStack(group.stack, group.slices[0].kernel, onShare, readSignal);
    },
    close() {},
  };
}

/** openCt without a worker. */
export async function openCtHere(files: readonly DroppedFile[], onProgress: (share: number) => void, signal?: AbortSignal): Promise<OpenedCt> {
  if (files.length === 1 && isVolumeFile(files[0].path)) return openVolumeFile(files[0]);
  if (files.length !== 1 || !ZIP.test(files[0].path)) return openFolder(files, onProgress, signal);
  const unpacked = await filesOfZip(files[0].file, (share) => onProgress(share / 2), signal);
  if (unpacked.length === 1 && isVolumeFile(unpacked[0].path)) return openVolumeFile(unpacked[0]);
  return openFolder(unpacked, (share) => onProgress((1 + share) / 2), signal);
}
