// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { CaseFile } from "../case/case_file";
import type { HandleEntry } from "../case/manifest";
import { AnswerEvaluator } from "../evaluation/answer_evaluator";
import { evaluatorModule } from "../evaluation/evaluator_module";
import type { Pose } from "../geometry/pose";
import type { Vector } from "../geometry/rotation";
import { type MovingData, writeMovingData } from "../movingdata/moving_data";
import type { BoundPhotograph } from "../movingdata/photograph_data";
import { LEAST_PASSWORD_LETTERS } from "../movingdata/password";
import { TEMPLATE_FILE, fillTemplate } from "../movingdata/page_template";
import { seal } from "../movingdata/sealed_payload";
import { posesOfCase } from "../planning/plan";

/** What the file shows as planned, and by what it moves. */
export interface MovingPlan {
  /** By handle. */
  poses: ReadonlyMap<string, Pose>;
  /** By its name in plans. */
  model: string;
  /** Prepared answers of CaseFile.followed. */
  answers: Uint8Array<ArrayBuffer>;
  /** Null: none in the file. */
  photograph: BoundPhotograph | null;
}

/** The same as tissueform export takes of a plan: nothing that identifies a person. */
export function movingDataOf(file: CaseFile, { poses, model, answers, photograph }: MovingPlan): MovingData {
  const { manifest } = file;
  // Answers know handles by their order in the session.
  const names = file.sessionRequest.handles.map(({ name }) => name);
  const handles = names.flatMap((name) => manifest.handles.filter((handle) => handle.name === name));
  return {
    title: "",
    software: manifest.provenance.software ?? "",
    model,
    headFrame: manifest.headFrame,
    handles: handles.map((handle) => ({ ...handle, pose: poseEntry(poses.get(handle.name), handle), isFree: true })),
    surfaces: file.surfaces.map(({ entry, positions, triangles, follows }) => ({ name: entry.name, kind: entry.kind, handle: entry.handle, positions, triangles, follows })),
    answers,
    photograph,
  };
}

function poseEntry(pose: Pose | undefined, handle: HandleEntry): HandleEntry["pose"] {
  if (pose === undefined) return handle.pose;
  const degrees = pose.rotationVector.map((part) => (part * 180) / Math.PI) as Vector;
  return { rotationVectorDeg: degrees, pivotMm: pose.pivotMm, translationMm: pose.translationMm, scale: pose.scale };
}

/** Whether the file will show its own plan, and not only the last picture before it. */
async function showsPlan(data: MovingData): Promise<boolean> {
  const poses = posesOfCase({ manifest: data });
  const evaluator = await AnswerEvaluator.open(data.answers, await evaluatorModule());
  return evaluator.evaluate(data.handles.flatMap(({ name }) => poses.get(name) ?? []), false).coverage === "covered";
}

/** `password`: "" for none. Rejects with an Error where the gateway does not have the page, and where the answers do not reach the plan. */
export async function movingFile(file: CaseFile, plan: MovingPlan, password: string): Promise<Blob> {
  if (password !== "" && Array.from(password.normalize("NFC")).length < LEAST_PASSWORD_LETTERS) {
    throw new Error(`a password of the moving file needs at least ${LEAST_PASSWORD_LETTERS} letters: better four words than one`);
  }
  const data = movingDataOf(file, plan);
  if (!(await showsPlan(data))) {
    const other = plan.model === "linear_elastic" ? "Gradient field" : "Linear elastic";
    throw new Error(`the plan moves bone beyond the range of this model's prepared answers, so the file could not show it: choose ${other}, or smaller moves`);
  }
  const reply = await fetch(new URL(TEMPLATE_FILE, document.baseURI));
  if (!reply.ok) throw new Error(`the gateway does not have the page of moving files (${TEMPLATE_FILE}): build the planner again with deploy/build_web.sh`);
  const template = await reply.text();
  return new Blob([fillTemplate(template, await seal(writeMovingData(data), password))], { type: "text/html" });
}
