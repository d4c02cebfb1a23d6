// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { messageOf } from "../calls/call_error";
import type { Vector } from "../geometry/rotation";
import { type Anchor, anchorPoint } from "../measures/anchor";
import { FACE_LANDMARKS } from "../measures/face_landmarks";
import { DrawnPhotograph } from "../photograph/drawn_photograph";
import { eyeBalls } from "../photograph/eyes";
import { MarkingView } from "../photograph/marking_view";
import { readInWorker, registerInWorker } from "../photograph/photograph_host";
import type { ReadPhotograph } from "../photograph/read_photograph";
import type { Registration } from "../photograph/registration";
import type { Workbench } from "../workbench/workbench";
import { button, el, newId, slider, whileBusy } from "./dom";

const LANDMARKS = [
  ...FACE_LANDMARKS.filter(({ name }) => ["pronasale", "subnasale", "labrale_superius", "soft_pogonion"].includes(name)),
  { name: "exocanthion_right", label: "Outer corner of the right eye", hint: "the patient’s right" },
  { name: "exocanthion_left", label: "Outer corner of the left eye", hint: "the patient’s left" },
];
const MIN_MARKS = 3;
/** The last color of the residual map. */
const MOST_MM = 3;

const PRIVACY = "A face photograph identifies the patient. It stays in this page. It leaves it only in a moving file or report that you save with the photograph shown.";

/** A photograph on its way to the head: what is marked on it, and what came of it. */
class Work {
  read: ReadPhotograph | null = null;
  marking: MarkingView | null = null;
  drawn: DrawnPhotograph | null = null;
  registration: Registration | null = null;
  readonly onPhotograph = new Map<string, Vector>();
  readonly onSkin = new Map<string, Anchor>();

  constructor(readonly bench: Workbench) {
    bench.shown.watch(() => this.drawn?.follow());
    const hide = () => this.drawn?.setHidden(bench.bite.value !== null || bench.map.legend.value !== null);
    bench.bite.watch(hide);
    bench.map.legend.watch(hide);
  }

  async open(files: readonly File[]): Promise<void> {
    const read = await readInWorker(await Promise.all(files.map(async (file) => ({ name: file.name, bytes: new Uint8Array(await file.arrayBuffer()) }))));
    const marking = await MarkingView.make(this.bench.view, read.photograph);
    this.remove();
    [this.read, this.marking] = [read, marking];
    this.showMarking(true);
    this.bench.view.look("front");
  }

  /** The photograph instead of the head. */
  showMarking(isShown: boolean): void {
    this.marking?.show(isShown);
    this.bench.gizmo.hide("photograph", isShown && this.marking !== null);
  }

  anchorOf(name: string): Anchor | undefined {
    const { placed, suggestions } = this.bench.landmarks;
    return this.onSkin.get(name) ?? placed.get(name) ?? suggestions.get(name);
  }

  get matched(): string[] {
    return LANDMARKS.map(({ name }) => name).filter((name) => this.onPhotograph.has(name) && this.anchorOf(name) !== undefined);
  }

  async register(isScaled: boolean): Promise<void> {
    const { file, view } = this.bench;
    if (this.read === null) return;
    const points = new Map(file.manifest.landmarks.map(({ name, positionMm }) => [name, positionMm]));
    for (const { name } of LANDMARKS) {
      const anchor = this.anchorOf(name);
      if (anchor !== undefined) points.set(name, anchorPoint(file.surfaces[anchor.surface], anchor));
    }
    const names = this.matched;
    const registration = await registerInWorker({
      photograph: this.read.photograph,
      skin: joined(view.head.skins.map(({ source }) => source)),
      from: names.map((name) => this.onPhotograph.get(name) as Vector),
      to: names.map((name) => points.get(name) as Vector),
      isScaled,
      masked: eyeBalls(points, file.manifest.headFrame),
    });
    this.drawn?.remove();
    this.drawn = await DrawnPhotograph.make(view.head, registration.bound);
    this.registration = registration;
    this.bench.photograph.value = registration.bound;
    this.showMarking(false);
  }

  remove(): void {
    this.drawn?.remove();
    this.marking?.remove();
    this.bench.gizmo.hide("photograph", false);
    this.bench.picking.value = null;
    this.bench.photograph.value = null;
    [this.read, this.marking, this.drawn, this.registration] = [null, null, null, null];
    this.onPhotograph.clear();
    this.onSkin.clear();
    this.bench.view.stage.invalidate();
  }
}

/** All skins as one surface. */
function joined(skins: readonly { positions: Float32Array; triangles: Uint32Array }[]): { positions: Float32Array<ArrayBuffer>; triangles: Uint32Array<ArrayBuffer> } {
  const positions = new Float32Array(skins.reduce((sum, skin) => sum + skin.positions.length, 0));
  const triangles = new Uint32Array(skins.reduce((sum, skin) => sum + skin.triangles.length, 0));
  let [vertex, corner] = [0, 0];
  for (const skin of skins) {
    positions.set(skin.positions, 3 * vertex);
    triangles.set(skin.triangles.map((v) => v + vertex), corner);
    vertex += skin.positions.length / 3;
    corner += skin.triangles.length;
  }
  return { positions, triangles };
}

/** Drop, mark, register, look. */
export function photographPart(bench: Workbench): HTMLElement {
  const work = new Work(bench);
  const id = newId("photograph");
  const status = el("div", { class: "photograph-notes", attributes: { role: "status" } });
  const steps = el("div");
  const say = (...texts: string[]) => status.replaceChildren(...texts.map((text) => el("p", { text })));
  const fail = (thrown: unknown) => say(sentence(messageOf(thrown)));
  const input = el("input", { id, attributes: { type: "file", multiple: "", accept: ".obj,.mtl,.ply,.gltf,.glb,.bin,.jpg,.jpeg,.png,.webp" } });
  const open = async (files: readonly File[]) => {
    if (files.length === 0) return;
    say("Reading the photograph.");
    await work.open(files).then(() => say(...(work.read?.notes ?? [])), fail);
    steps.replaceChildren(...(work.read === null ? [] : [markingStep(work, say, fail, update)]));
  };
  const update = () => steps.replaceChildren(...(work.read === null ? [] : [markingStep(work, say, fail, update)]), ...(work.drawn === null ? [] : [shownStep(work, work.drawn)]));
  input.addEventListener("change", () => void open(Array.from(input.files ?? [])));
  const element = el("div", { class: "photograph-part" }, [
    el("p", { class: "quiet", text: PRIVACY }),
    el("div", { class: "field" }, [el("label", { text: "Files (OBJ with MTL and image, PLY, glTF)", attributes: { for: id } }), input]),
    status,
    steps,
  ]);
  element.addEventListener("dragover", (event) => event.preventDefault());
  element.addEventListener("drop", (event) => {
    event.preventDefault();
    void open(Array.from(event.dataTransfer?.files ?? []));
  });
  return element;
}

function sentence(text: string): string {
  return `${text.charAt(0).toUpperCase()}${text.slice(1)}${text.endsWith(".") ? "" : "."}`;
}

function markingStep(work: Work, say: (...texts: string[]) => void, fail: (thrown: unknown) => void, update: () => void): HTMLElement {
  const scaled = el("input", { attributes: { type: "checkbox" } });
  scaled.checked = work.read?.unit === "unknown";
  const register: HTMLButtonElement = button("Register", () => {
    say("Registering the photograph.");
    const run = async () => {
      await work.register(scaled.checked);
      update();
      const { registration } = work;
      if (registration !== null) say(`Distance to the CT's skin: ${registration.medianMm.toFixed(2)} mm (median), ${registration.percentile95Mm.toFixed(2)} mm (95 %), without the eyes.`, ...registration.warnings);
    };
    void whileBusy(register, run, fail);
  });
  const count = work.matched.length;
  register.disabled = count < MIN_MARKS;
  const turn = button("Turn by 90°", () => work.marking?.turn());
  const list = el("ul", { class: "landmarks" }, LANDMARKS.map((landmark) => landmarkItem(work, landmark, update)));
  return el("div", {}, [
    el("p", { class: "quiet", text: `Mark three or more points on the photograph; ${count} of them are on both surfaces.` }),
    el("div", { class: "buttons" }, [button("Show the photograph alone", () => work.showMarking(true)), button("Show the CT", () => work.showMarking(false)), turn]),
    list,
    el("label", { class: "check" }, [scaled, "Scale is not known"]),
    el("div", { class: "buttons" }, [register, button("Remove the photograph", () => {
      work.remove();
      say();
      update();
    })]),
  ]);
}

function landmarkItem(work: Work, { name, label, hint }: { name: string; label: string; hint: string }, update: () => void): HTMLElement {
  const { bench } = work;
  const isMarked = work.onPhotograph.has(name);
  const isOnSkin = work.anchorOf(name) !== undefined;
  const mark = button("Photograph", () => {
    work.showMarking(true);
    bench.picking.value = {
      prompt: `On the photograph: click ${label}, ${hint}.`,
      kinds: [],
      take: () => {},
      takeAt(x, y) {
        const point = work.marking?.pointAt(x, y) ?? null;
        if (point === null) return;
        work.onPhotograph.set(name, point);
        work.marking?.showMarks(Array.from(work.onPhotograph.values()));
        bench.picking.value = null;
        update();
      },
    };
  }, { attributes: { "aria-label": `Mark ${label} on the photograph` } });
  const place = button("CT", () => {
    work.showMarking(false);
    bench.picking.value = {
      prompt: `On the CT's skin: click ${label}, ${hint}.`,
      kinds: ["skin"],
      take(anchor) {
        if (anchor === null) return;
        work.onSkin.set(name, anchor);
        bench.picking.value = null;
        work.showMarking(work.registration === null);
        update();
      },
    };
  }, { attributes: { "aria-label": `Mark ${label} on the CT` } });
  const state = `photograph: ${isMarked ? "marked" : "missing"}; CT: ${isOnSkin ? "known" : "missing"}`;
  return el("li", { attributes: { "data-status": isMarked && isOnSkin ? "placed" : "missing" } }, [el("span", {}, [el("strong", { text: label }), el("small", { text: state })]), mark, place]);
}

function shownStep(work: Work, drawn: DrawnPhotograph): HTMLElement {
  const { stage } = work.bench.view;
  const check = (label: string, isOn: boolean, change: (isOn: boolean) => void) => {
    const box: HTMLInputElement = el("input", { attributes: { type: "checkbox" }, on: { change: () => change(box.checked) } });
    box.checked = isOn;
    return el("label", { class: "check" }, [box, label]);
  };
  const show = check("Show the photograph", drawn.mesh.visible, (isOn) => {
    drawn.setShown(isOn);
    stage.invalidate();
  });
  const residuals = check(`Color by distance to the CT (0 to ${MOST_MM} mm)`, false, (isOn) => {
    drawn.showDistances(isOn ? (work.registration?.distancesMm ?? null) : null, MOST_MM);
    stage.invalidate();
  });
  const opacity = slider("Opacity of the photograph", { least: 0, most: 1, step: 0.01, value: drawn.mesh.material.opacity }, (value) => {
    drawn.setOpacity(value);
    stage.invalidate();
  });
  return el("div", {}, [show, residuals, el("label", { class: "inline" }, ["Opacity", opacity]), el("p", { class: "quiet", text: "A color map of the skin and occlusal contacts hide the photograph while they are shown." })]);
}
