// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { add, cross, norm, scaled, type Vector } from "../geometry/rotation";
import type { DicomHeader } from "./dicom_header";
import { CT_IMAGE_CLASS, type Tags } from "./dicom_tags";
import { kernelName } from "./kernel_kind";

// The images of a multi-frame file (Enhanced CT, PS3.3, C.7.6.16), each as the header of a slice: core/imaging/ct/dicom_frames.cc.

const SHARED_GROUPS = "x52009229";
const GROUPS_OF_FRAMES = "x52009230";
/** Of one file: more than any scanner writes. */
const MAX_FRAMES = 65535;

type Mutable = { -readonly [Key in keyof DicomHeader]: DicomHeader[Key] };

function readGeometry(groups: Tags, frame: Mutable): void {
  for (const item of groups.items("x00209113")) frame.position = (item.numbers("x00200032", 3) as Vector | null) ?? frame.position;
  for (const item of groups.items("x00209116")) {
    const directions = item.numbers("x00200037", 6);
    if (directions !== null) frame.axes = [directions.slice(0, 3) as Vector, directions.slice(3) as Vector];
  }
  for (const item of groups.items("x00289110")) frame.pixelSpacing = (item.numbers("x00280030", 2) as [number, number] | null) ?? frame.pixelSpacing;
}

function readValuesAndKind(groups: Tags, frame: Mutable): void {
  for (const item of groups.items("x00289145")) [frame.intercept, frame.slope] = [item.number("x00281052"), item.number("x00281053")];
  for (const item of groups.items("x00209111")) {
    frame.acquisitionTimeS = item.secondsOfBoth("x00189074");
    frame.acquisitionNumber = item.short("x00209156");
    frame.reconstruction += `|${item.short("x00209128")}`;
  }
  for (const item of groups.items("x00189329")) if (item.text("x00089007").includes("LOCALIZER")) frame.kind = "localizer";
  for (const item of groups.items("x00189314")) {
    frame.kernel = kernelName(item.text("x00181210"));
    frame.reconstruction += `|${item.text("x00181210")}`;
  }
}

function withGroups(groups: readonly Tags[], header: DicomHeader): DicomHeader {
  const frame: Mutable = { ...header };
  for (const group of groups) {
    readGeometry(group, frame);
    readValuesAndKind(group, frame);
  }
  return frame;
}

/** Cone-beam devices write a whole volume into the plain CT class: the place of the first frame, and the others follow along the normal. */
function evenFrames(data: Tags, file: DicomHeader): DicomHeader[] {
  const count = data.integer("x00280008") ?? 0;
  const spacing = data.number("x00180088") ?? data.number("x00180050") ?? 0;
  if (!["", CT_IMAGE_CLASS].includes(file.classUid) || count < 2 || count > MAX_FRAMES || file.position === null || file.axes === null || spacing === 0) return [];
  const normal = cross(...file.axes);
  const step = scaled(normal, spacing / norm(normal));
  const first = file.position;
  return Array.from({ length: count }, (_, frame) => ({ ...file, kind: "ct slice" as const, frame, frames: count, hasEvenFrames: true, position: add(first, scaled(step, frame)) }));
}

/** `file`: the header of a multi-frame file. Empty where it does not distinguish its frames. */
export function framesOf(data: Tags, file: DicomHeader): DicomHeader[] {
  const groups = data.items(GROUPS_OF_FRAMES);
  if (groups.length === 0) return evenFrames(data, file);
  // More or fewer groups than frames: it is unknown which place belongs to which.
  if (data.integer("x00280008") !== groups.length || groups.length > MAX_FRAMES) return [];
  const common = withGroups(data.items(SHARED_GROUPS), { ...file, kind: "ct slice" });
  return groups.map((group, frame) => ({ ...withGroups([group], common), frame, frames: groups.length }));
}
