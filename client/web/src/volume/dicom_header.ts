// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { cross, type Vector } from "../geometry/rotation";
import { CT_IMAGE_CLASS, Tags } from "./dicom_tags";
import { kernelName } from "./kernel_kind";

/** What a DICOM file holds, as far as a CT volume is concerned: the kinds of core/imaging/ct/dicom_header.h. */
export type DicomKind = "ct slice" | "localizer" | "secondary capture" | "other modality" | "multi-frame" | "color" | "deflated" | "no image" | "directory" | "damaged";

/** The header of one image: of a file, or of a frame of a multi-frame file. Everything except the modality may name the patient: it stays in the worker, and only geometry, kernel and numbers leave it. */
export interface DicomHeader {
  readonly file: Blob;
  /** Place among the files, in the order of their names, from 1. */
  readonly fileNumber: number;
  readonly kind: DicomKind;
  /** Of the file's images, from 0. */
  readonly frame: number;
  /** How many images the file has. */
  readonly frames: number;
  /** Placed by SpacingBetweenSlices, as the file has no place for each. */
  readonly hasEvenFrames: boolean;
  readonly transferSyntax: string;
  readonly modality: string;
  readonly classUid: string;
  readonly imageType: string;
  readonly kernel: string;
  readonly contrast: string;
  readonly description: string;
  readonly patient: string;
  readonly patientPosition: string;
  /** Kernel, voltage, phase: the same in one volume. */
  readonly reconstruction: string;
  readonly studyUid: string;
  readonly seriesUid: string;
  readonly frameUid: string;
  readonly seriesNumber: number | null;
  readonly instanceNumber: number | null;
  readonly acquisitionNumber: number | null;
  /** All three from some day. */
  readonly acquisitionTimeS: number | null;
  readonly seriesTimeS: number | null;
  readonly contentTimeS: number | null;
  readonly rows: number;
  readonly columns: number;
  /** LPS, millimeters: the center of the first pixel. */
  readonly position: Vector | null;
  /** Along a row, along a column. */
  readonly axes: readonly [Vector, Vector] | null;
  /** Millimeters between rows, between columns. */
  readonly pixelSpacing: readonly [number, number] | null;
  readonly thickness: number;
  readonly slope: number | null;
  readonly intercept: number | null;
  readonly rescaleType: string;
  readonly wasLossy: boolean;
  readonly hasBurnedText: boolean;
}

const CT_CLASSES = [CT_IMAGE_CLASS, "1.2.840.10008.5.1.4.1.1.2.1", "1.2.840.10008.5.1.4.1.1.2.2"];
const SECONDARY_CAPTURE = "1.2.840.10008.5.1.4.1.1.7";
const PHOTOGRAPH = "1.2.840.10008.5.1.4.1.1.77.1";
const DIRECTORY = "1.2.840.10008.1.3.10";

export function isCtClass(classUid: string): boolean {
  return CT_CLASSES.includes(classUid);
}

export function isLocalizer(imageType: string): boolean {
  return imageType.includes("LOCALIZER") || imageType.includes("SCOUT");
}

/** Row direction x column direction, as long as the header makes it. */
export function normalOf(axes: readonly [Vector, Vector]): Vector {
  return cross(axes[0], axes[1]);
}

/** "file 12 of the folder, frame 3 (instance number 31)". */
export function nameOf(header: DicomHeader): string {
  return `file ${header.fileNumber} of the folder${header.frames > 1 ? `, frame ${header.frame + 1}` : ""}${header.instanceNumber === null ? "" : ` (instance number ${header.instanceNumber})`}`;
}

export function describeKind(header: DicomHeader): string {
  switch (header.kind) {
    case "ct slice": return "a CT slice";
    case "localizer": return "a localizer (scout view)";
    case "secondary capture": return "a photograph or copy of a screen (secondary capture)";
    case "other modality": return header.modality === "CT" ? "not a conventional CT image" : `of modality ${header.modality}`;
    case "multi-frame": return "a multi-frame image without frame positions";
    case "color": return "a color image";
    case "deflated": return "a deflated file, which is not supported: export it in another transfer syntax";
    case "no image": return "no image";
    case "directory": return "a directory (DICOMDIR)";
    case "damaged": return "a truncated or damaged DICOM file";
  }
}

/** Each test may trust the ones before: a directory has no modality, a photograph may say CT, and a report of doses has no rows. */
function kindOf(mediaClass: string, data: Tags, rows: number, columns: number): DicomKind {
  const text = (tag: string) => data.text(tag);
  const classUid = text("x00080016");
  if (mediaClass === DIRECTORY) return "directory";
  if (classUid.startsWith(PHOTOGRAPH) || classUid === SECONDARY_CAPTURE || classUid.startsWith(`${SECONDARY_CAPTURE}.`)) return "secondary capture";
  if (text("x00080060") !== "CT") return rows === 0 ? "no image" : "other modality";
  const isScout = isLocalizer(text("x00080008"));
  const frames = data.integer("x00280008") ?? 1;
  if (frames > 1 || (isCtClass(classUid) && classUid !== CT_IMAGE_CLASS)) return isScout ? "localizer" : "multi-frame";
  if (rows === 0 || columns === 0) return classUid === CT_IMAGE_CLASS ? "damaged" : "no image";
  if (data.short("x00280002") > 1 || !text("x00280004").startsWith("MONOCHROME")) return "color";
  if (isScout) return "localizer";
  return classUid === "" || classUid === CT_IMAGE_CLASS ? "ct slice" : "other modality";
}

/** A modality by its form; other texts may be anything. */
function modalityOf(text: string): string {
  return /^[A-Z0-9]{1,16}$/.test(text) ? text : text === "" ? "" : "unknown";
}

export function headerOf(file: Blob, fileNumber: number, data: Tags, mediaClass: string, transferSyntax: string): DicomHeader {
  const text = (tag: string) => data.text(tag);
  const [rows, columns] = [data.short("x00280010"), data.short("x00280011")];
  const kind = kindOf(mediaClass, data, rows, columns);
  const directions = data.numbers("x00200037", 6);
  return {
    file, fileNumber, kind, transferSyntax, rows, columns, frame: 0, frames: 1, hasEvenFrames: false,
    modality: modalityOf(text("x00080060")),
    classUid: kind === "ct slice" ? CT_IMAGE_CLASS : text("x00080016"),
    imageType: text("x00080008"),
    kernel: kernelName(text("x00181210")),
    contrast: text("x00180010"),
    description: text("x0008103e"),
    patient: [text("x00100020"), text("x00100010"), text("x00100030")].join("\n"),
    patientPosition: text("x00185100"),
    reconstruction: [text("x00181210"), text("x00180060"), text("x00200100")].join("|"),
    studyUid: text("x0020000d"),
    seriesUid: text("x0020000e"),
    frameUid: text("x00200052"),
    seriesNumber: data.integer("x00200011"),
    instanceNumber: data.integer("x00200013"),
    acquisitionNumber: data.integer("x00200012"),
    acquisitionTimeS: data.seconds("x00080022", "x00080032") ?? data.secondsOfBoth("x0008002a"),
    seriesTimeS: data.seconds("x00080021", "x00080031"),
    contentTimeS: data.seconds("x00080023", "x00080033"),
    position: data.numbers("x00200032", 3) as Vector | null,
    axes: directions === null ? null : [directions.slice(0, 3) as Vector, directions.slice(3) as Vector],
    pixelSpacing: data.numbers("x00280030", 2) as [number, number] | null,
    thickness: data.number("x00180050") ?? 0,
    slope: data.number("x00281053"),
    intercept: data.number("x00281052"),
    rescaleType: text("x00281054"),
    wasLossy: text("x00282110") === "01",
    hasBurnedText: text("x00280301") === "YES",
  };
}

export function unreadable(file: Blob, fileNumber: number, kind: "damaged" | "deflated"): DicomHeader {
  return {
    file, fileNumber, kind, transferSyntax: "", frame: 0, frames: 1, hasEvenFrames: false, modality: "", classUid: "", imageType: "", kernel: "", contrast: "", description: "",
    patient: "", patientPosition: "", reconstruction: "", studyUid: "", seriesUid: "", frameUid: "", seriesNumber: null, instanceNumber: null, acquisitionNumber: null,
    acquisitionTimeS: null, seriesTimeS: null, contentTimeS: null, rows: 0, columns: 0, position: null, axes: null, pixelSpacing: null,
    thickness: 0, slope: null, intercept: null, rescaleType: "", wasLossy: false, hasBurnedText: false,
  };
}
