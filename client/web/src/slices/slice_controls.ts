// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { button, el, select } from "../panels/dom";
import type { LabelMap } from "../volume/volume";
import { KEYS } from "./pane_keys";
import type { Tool } from "./pane_pointers";
import { PLANES, type Plane } from "./plane_frame";
import { type Measurement, type Outline, type SliceScene, isComplete, measurementText } from "./slice_scene";
import { PRESETS, type Window, wholeRange } from "./window_level";

const TOOLS: readonly { tool: Tool; label: string; title: string }[] = [
  { tool: "crosshair", label: "Crosshair", title: "Drag to move the crosshair, points and planes" },
  { tool: "window", label: "Window", title: "Drag sideways for the width, up and down for the center; also with the right button" },
  { tool: "pan", label: "Pan", title: "Drag to pan; also with Shift or the middle button. Ctrl and the wheel zoom" },
  { tool: "distance", label: "Distance", title: "Click two points, or drag from one to the other" },
  { tool: "angle", label: "Angle", title: "Click three points; the angle is at the second one" },
];
const PLANE_LABELS: Record<Plane, string> = { axial: "Axial", coronal: "Coronal", sagittal: "Sagittal" };

/** What the controls change that others have to know. */
export interface ControlListener {
  onChanged(): void;
  onFit(): void;
  onRemove(measurement: Measurement): void;
}

/** Around the panes: window, tools, which pane a narrow screen shows, legend, measurements, shortcuts. */
export class SliceControls {
  readonly element: HTMLElement;
  tool: Tool = "crosshair";
  private readonly bar: HTMLElement;
  private readonly values = el("output", { class: "quiet window-values" });
  private readonly legend = el("ul", { class: "slice-legend", attributes: { "aria-label": "Legend of the slices" } });
  private readonly measurements = el("ul", { class: "slice-measurements", attributes: { "aria-label": "Measurements" } });
  private readonly status = el("p", { class: "hidden", attributes: { role: "status" } });
  private readonly presets: { element: HTMLElement; set(choices: { value: Window | null; label: string }[], index: number): void };
  private labelColors: ReadonlyMap<number, string> = new Map();
  private shownLegend: { key: string; labels: LabelMap | null } = { key: "", labels: null };
  private shownWindow: Window | null = null;
  private whole: Window | null = null;

  constructor(
    private readonly scene: SliceScene,
    private readonly listener: ControlListener,
    panes: readonly HTMLElement[],
  ) {
    this.presets = select<Window | null>("Window", this.choices(), (window) => {
      if (window !== null) scene.window = window;
      listener.onChanged();
    });
    this.bar = el("div", { class: "slice-bar", attributes: { role: "toolbar", "aria-label": "Slices" } }, [this.presets.element, this.values, this.toolButtons(), button("Fit", () => listener.onFit())]);
    this.legend.hidden = true;
    this.measurements.hidden = true;
    const shown = el("div", { class: "slice-panes", attributes: { "data-shown": PLANES[0] } }, [...panes]);
    this.element = el("div", { class: "slices" }, [this.bar, this.planeButtons(shown), shown, this.legend, this.measurements, shortcuts(), this.status]);
  }

  /** Behind the tools. */
  add(control: HTMLElement): void {
    this.bar.append(control);
  }

  /** Read aloud, not seen. */
  say(text: string): void {
    this.status.textContent = text;
  }

  /** The volume is another one. */
  showVolume(): void {
    this.whole = this.scene.volume === null ? null : wholeRange(this.scene.volume);
    this.shownWindow = null;
    this.showWindow();
  }

  showWindow(): void {
    const { window } = this.scene;
    if (this.shownWindow === window) return;
    this.shownWindow = window;
    this.values.textContent = `center ${window.center.toFixed(0)}, width ${window.width.toFixed(0)}`;
    const choices = this.choices();
    const index = choices.findIndex(({ value }) => value?.center === window.center && value.width === window.width);
    this.presets.set(choices, index < 0 ? choices.length - 1 : index);
  }

  /** `colors`: of the labels that are drawn; left out: as before. */
  showLegend(colors: ReadonlyMap<number, string> = this.labelColors): void {
    // Outlines of one name are one entry.
    const named = new Map(this.scene.outlines.map(({ outline }) => [outline.name, outline]));
    const key = Array.from(named.values(), (outline) => `${outline.name} ${outline.color} ${this.scene.isDrawn(outline)}`).join();
    const { labels } = this.scene;
    // Outlines that follow a drag change nothing here, and a button that is made again would lose the focus.
    if (key === this.shownLegend.key && labels === this.shownLegend.labels && colors === this.labelColors) return;
    this.shownLegend = { key, labels };
    this.labelColors = colors;
    const outlines = Array.from(named.values(), (outline) => this.outlineItem(outline));
    const areas = labels === null ? [] : Array.from(colors, ([label, color]) => el("li", {}, [swatch(color, "area"), labels.names.get(label) ?? `Label ${label}`]));
    this.legend.replaceChildren(...outlines, ...areas);
    this.legend.hidden = outlines.length + areas.length === 0;
  }

  /** A button that hides or shows the outlines of this name. */
  private outlineItem(outline: Outline): HTMLElement {
    const { name, color, dashed } = outline;
    const { switched } = this.scene;
    const press = () => {
      if (!switched.delete(name)) switched.add(name);
      show();
      this.listener.onChanged();
    };
    const control = button(name, press);
    control.prepend(swatch(color, dashed === true ? "line dashed" : "line"));
    const show = () => control.setAttribute("aria-pressed", String(this.scene.isDrawn(outline)));
    show();
    return el("li", {}, [control]);
  }

  showMeasurements(): void {
    const complete = this.scene.measurements.filter(isComplete);
    this.measurements.replaceChildren(...complete.map((measurement) => this.measurementItem(measurement)));
    this.measurements.hidden = complete.length === 0;
  }

  private measurementItem(measurement: Measurement): HTMLElement {
    const text = `${measurement.kind === "distance" ? "Distance" : "Angle"} ${measurementText(measurement)}, ${measurement.plane}`;
    const remove = button("Remove", () => this.listener.onRemove(measurement), { attributes: { "aria-label": `Remove ${text}` } });
    return el("li", {}, [text, remove]);
  }

  private choices(): { value: Window | null; label: string }[] {
    const whole = this.whole === null ? [] : [{ value: this.whole, label: "Whole range" }];
    return [...PRESETS.map(({ label, window }) => ({ value: window, label })), ...whole, { value: null, label: "Own" }];
  }

  private toolButtons(): HTMLElement {
    return choiceButtons("Tool", TOOLS.map(({ tool, label, title }) => ({ value: tool, label, title })), (tool) => (this.tool = tool));
  }

  private planeButtons(panes: HTMLElement): HTMLElement {
    const show = (plane: Plane) => {
      panes.dataset.shown = plane;
      this.listener.onChanged();
    };
    const buttons = choiceButtons("Shown slice", PLANES.map((plane) => ({ value: plane, label: PLANE_LABELS[plane], title: "" })), show);
    buttons.classList.add("slice-choice");
    return buttons;
  }
}

/** Buttons of which one is pressed, the first at the start. */
function choiceButtons<T>(label: string, choices: readonly { value: T; label: string; title: string }[], onChoose: (value: T) => void): HTMLElement {
  const press = (index: number) => {
    buttons.forEach((other, k) => other.setAttribute("aria-pressed", String(k === index)));
    onChoose(choices[index].value);
  };
  const buttons = choices.map(({ label: text, title }, index) => button(text, () => press(index), { attributes: title === "" ? {} : { title } }));
  const group = el("div", { class: "group", attributes: { role: "group", "aria-label": label } }, buttons);
  buttons.forEach((other, k) => other.setAttribute("aria-pressed", String(k === 0)));
  return group;
}

function swatch(color: string, kind: string): HTMLElement {
  const mark = el("span", { class: `slice-swatch ${kind}`, attributes: { "aria-hidden": "true" } });
  mark.style.setProperty("--color", color);
  return mark;
}

function shortcuts(): HTMLElement {
  const rows = KEYS.flatMap(([keys, text]) => [el("dt", { text: keys }), el("dd", { text })]);
  return el("details", { class: "slice-keys" }, [el("summary", { text: "Keys and pointers" }), el("p", { class: "quiet", text: "Wheel: next slice. Ctrl and wheel: zoom. Shift and drag: pan. Right button: window. Two fingers: pan and zoom." }), el("dl", {}, rows)]);
}
