// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { MoveKey } from "../geometry/pose";
import type { GizmoMode } from "../scene/gizmo";
import type { Plan } from "../planning/plan";
import { VIEWS, type ViewName } from "../scene/views";
import type { HeadView } from "../scene/head_view";
import type { Stage } from "../scene/stage";
import type { Workbench } from "../workbench/workbench";
import { button, el } from "./dom";

const STEP = 0.5;
const SMALL_STEP = 0.1;
const ORBIT_RADIANS = Math.PI / 36;

const MOVES: Record<string, [MoveKey, number]> = {
  w: ["forwardMm", 1],
  s: ["forwardMm", -1],
  a: ["leftMm", -1],
  d: ["leftMm", 1],
  e: ["upMm", 1],
  q: ["upMm", -1],
  i: ["pitchDeg", 1],
  k: ["pitchDeg", -1],
  u: ["rollDeg", -1],
  o: ["rollDeg", 1],
  j: ["yawDeg", -1],
  l: ["yawDeg", 1],
};

const HELP: readonly [string, string][] = [
  ["W S · A D · E Q", "forward and back · to the patient’s right and left · up and down, by 0.5 mm"],
  ["I K · U O · J L", "pitch · roll · yaw, by 0.5°"],
  ["Shift", "with these: by 0.1"],
  ["N", "the next segment"],
  ["Enter, Escape", "when choosing a point: take the point in the middle of the picture; cancel"],
  ["G", "switch the gizmo between rotation and translation"],
  ["Arrows, + −", "rotate and zoom the view"],
  ["1 … 5", "front, left, right, 3/4, below"],
  ["Ctrl+Z, Ctrl+Y", "undo, redo"],
  ["?", "this help"],
];

/** Keys of the picture that turn the camera; true where `event` was one. */
export function lookByKey(view: Pick<HeadView, "look"> & { stage: Pick<Stage, "orbit" | "zoom"> }, event: KeyboardEvent): boolean {
  if (event.ctrlKey || event.metaKey || event.altKey) return false;
  const named = (Object.keys(VIEWS) as ViewName[]).find((name) => VIEWS[name].key === event.key);
  if (named !== undefined) view.look(named);
  else if (event.key === "ArrowLeft") view.stage.orbit(-ORBIT_RADIANS, 0);
  else if (event.key === "ArrowRight") view.stage.orbit(ORBIT_RADIANS, 0);
  else if (event.key === "ArrowUp") view.stage.orbit(0, ORBIT_RADIANS);
  else if (event.key === "ArrowDown") view.stage.orbit(0, -ORBIT_RADIANS);
  else if (event.key === "+" || event.key === "=") view.stage.zoom(0.9);
  else if (event.key === "-") view.stage.zoom(1 / 0.9);
  else return false;
  return true;
}

/** All keys of the planner: those of the picture while it has the focus, undo and redo everywhere but in fields of text. */
export function bindKeys(bench: Workbench, help: HTMLDialogElement): void {
  const { surface } = bench.view.stage;
  let mode: GizmoMode = "translate";
  let isMoving = false;
  const move = (event: KeyboardEvent): boolean => {
    const entry = MOVES[event.key.toLowerCase()];
    if (entry === undefined || event.ctrlKey || event.metaKey || event.altKey) return false;
    const [key, sign] = entry;
    const index = bench.selected.value;
    isMoving = true;
    bench.plan.change(index, { [key]: bench.plan.moves[index][key] + sign * (event.shiftKey ? SMALL_STEP : STEP) }, false);
    return true;
  };
  const other = (event: KeyboardEvent): boolean => {
    if (event.ctrlKey || event.metaKey || event.altKey) return false;
    if (event.key === "n") bench.selected.value = (bench.selected.value + 1) % bench.plan.handles.length;
    else if (event.key === "g") bench.gizmo.setMode((mode = mode === "translate" ? "rotate" : "translate"));
    else if (event.key === "?") help.showModal();
    else return false;
    return true;
  };
  surface.addEventListener("keydown", (event) => {
    if (move(event) || other(event) || lookByKey(bench.view, event)) event.preventDefault();
  });
  const finish = () => {
    if (isMoving) bench.plan.change(bench.selected.value, {}, true);
    isMoving = false;
  };
  surface.addEventListener("keyup", finish);
  surface.addEventListener("blur", finish);
  document.addEventListener("keydown", (event) => undoByKey(bench.plan, event));
}

/** Undo and redo, but in a field of text that is being edited; true where `event` was one of them. */
export function undoByKey(plan: Pick<Plan, "undo" | "redo">, event: KeyboardEvent): boolean {
  const isText = event.target instanceof HTMLInputElement && event.target.type === "text" && event.target.classList.contains("editing");
  if (!(event.ctrlKey || event.metaKey) || isText) return false;
  const key = event.key.toLowerCase();
  if (key === "z" && !event.shiftKey) plan.undo();
  else if (key === "y" || (key === "z" && event.shiftKey)) plan.redo();
  else return false;
  event.preventDefault();
  return true;
}

/** The keys in a dialog. */
export function helpDialog(): HTMLDialogElement {
  const rows = HELP.flatMap(([keys, text]) => [el("dt", { text: keys }), el("dd", { text })]);
  const dialog = el("dialog", { attributes: { "aria-label": "Keyboard shortcuts" } }, [
    el("h2", { text: "Keyboard shortcuts, while the picture has the focus" }),
    el("dl", {}, rows),
    button("Close", () => dialog.close()),
  ]);
  return dialog;
}
