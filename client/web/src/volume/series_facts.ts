// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { dot, norm, scaled, type Vector } from "../geometry/rotation";
import { isCtClass, isLocalizer, normalOf, type DicomHeader } from "./dicom_header";
import { CT_IMAGE_CLASS } from "./dicom_tags";
import { kernelKindOf, type KernelKind } from "./kernel_kind";

type Plane = "axial" | "coronal" | "sagittal" | "oblique" | "placeless";

/** What a series is, by the headers of its images: what the rule decides by (core/imaging/series/series_facts.h). Numbers are of slices at different places. */
export interface SeriesFacts {
  readonly key: string;
  readonly modality: string;
  readonly number: number;
  readonly images: number;
  readonly setAside: number;
  readonly slices: number;
  readonly duplicates: number;
  readonly missing: number;
  readonly framesOfReference: number;
  readonly orientations: number;
  readonly plane: Plane;
  readonly spacing: number;
  readonly thickness: number;
  readonly coverage: number;
  readonly kernel: KernelKind;
  readonly hasContrast: boolean;
  readonly isLocalizer: boolean;
  readonly isDerived: boolean;
  readonly isMultiFrame: boolean;
  readonly withoutHounsfield: number;
}

/** Farther away nothing is scanned. */
export const MAX_POSITION_MM = 1e5;
const SAME_PLACE_MM = 0.01;
const SAME_DIRECTION = 1e-4;
/** A gantry is tilted by up to 30 degrees. */
const AXIAL_COSINE = Math.cos((31 * Math.PI) / 180);
const GAP_SPACINGS = 1.5;

/** The usual one of some numbers: missing slices do not move a median, as they would a mean. */
export function upperMedian(values: readonly number[]): number {
  return values.length === 0 ? 0 : [...values].sort((a, b) => a - b)[Math.floor(values.length / 2)];
}

function unitNormal(axes: readonly [Vector, Vector]): Vector {
  const normal = normalOf(axes);
  const length = norm(normal);
  return length > 0 ? scaled(normal, 1 / length) : [0, 0, 1];
}

function planeOf(normal: Vector): Plane {
  if (Math.abs(normal[2]) >= AXIAL_COSINE) return "axial";
  if (Math.abs(normal[1]) >= AXIAL_COSINE) return "coronal";
  return Math.abs(normal[0]) >= AXIAL_COSINE ? "sagittal" : "oblique";
}

/** Sorted, along the first one's normal. */
function placesOf(images: readonly DicomHeader[]): { normals: Vector[]; places: number[] } {
  const normals: Vector[] = [];
  const places: number[] = [];
  for (const { position, axes } of images) {
    if (position === null || axes === null || position.some((x) => Math.abs(x) > MAX_POSITION_MM) || axes.flat().some((x) => Math.abs(x) >= 2)) continue;
    const normal = unitNormal(axes);
    if (!normals.some((known) => dot(known, normal) > 1 - SAME_DIRECTION)) normals.push(normal);
    places.push(dot(normals[0], position));
  }
  return { normals, places: places.sort((a, b) => a - b) };
}

function measure(places: readonly number[]) {
  const steps = places.slice(1).map((place, i) => place - places[i]);
  const apart = steps.filter((step) => step > SAME_PLACE_MM);
  const spacing = upperMedian(apart);
  const missing = apart.filter((step) => step > GAP_SPACINGS * spacing).reduce((sum, step) => sum + Math.min(Math.round(step / spacing) - 1, 100_000), 0);
  const duplicates = steps.length - apart.length;
  return { spacing, missing, duplicates, slices: places.length - duplicates, coverage: apart.length === 0 ? 0 : places[places.length - 1] - places[0] + spacing };
}

const objectKind = (header: DicomHeader) => `${header.classUid}|${isLocalizer(header.imageType)}`;

/** The images are the CT slices or, in a series without them, the objects of the most frequent kind. */
function imagesOf(objects: readonly DicomHeader[]): DicomHeader[] {
  const counts = new Map<string, number>();
  for (const object of objects) counts.set(objectKind(object), (counts.get(objectKind(object)) ?? 0) + 1);
  const slices = `${CT_IMAGE_CLASS}|false`;
  const kind = counts.has(slices) ? slices : [...counts].sort((a, b) => b[1] - a[1])[0][0];
  return objects.filter((object) => objectKind(object) === kind);
}

/** REQUIRES: headers of one series, at least one. */
export function factsOf(key: string, objects: readonly DicomHeader[]): SeriesFacts {
  const images = imagesOf(objects);
  const first = images[0];
  const { normals, places } = placesOf(images);
  return {
    key,
    modality: first.modality,
    number: first.seriesNumber ?? 0,
    images: images.length,
    setAside: objects.length - images.length,
    framesOfReference: new Set(images.map((image) => image.frameUid)).size,
    orientations: normals.length,
    plane: normals.length > 0 ? planeOf(normals[0]) : "placeless",
    thickness: first.thickness,
    kernel: kernelKindOf(first.kernel),
    hasContrast: images.some((image) => image.contrast !== ""),
    isLocalizer: isLocalizer(first.imageType),
    isDerived: images.some((image) => image.imageType.startsWith("DERIVED")),
    isMultiFrame: isCtClass(first.classUid) && first.classUid !== CT_IMAGE_CLASS,
    withoutHounsfield: images.filter((image) => image.slope === null || image.intercept === null || !["", "HU"].includes(image.rescaleType)).length,
    ...measure(places),
  };
}

/** "231 axial slices, 0.60 mm apart, over 138 mm, soft kernel". */
export function describeFacts(facts: SeriesFacts): string {
  const kernel = { soft: "soft kernel", bone: "sharp kernel", unknown: "kernel of unknown kind" }[facts.kernel];
  const aside = facts.setAside > 0 ? `; ignored: ${facts.setAside} other object${facts.setAside > 1 ? "s" : ""}` : "";
  return `${facts.slices} ${facts.plane} slices, ${facts.spacing.toFixed(2)} mm apart, over ${facts.coverage.toFixed(0)} mm, ${kernel}${facts.hasContrast ? ", contrast medium" : ""}${aside}`;
}
