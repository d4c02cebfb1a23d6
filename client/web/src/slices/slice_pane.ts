// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type Vector, add, dot, scaled, subtract } from "../geometry/rotation";
import { el } from "../panels/dom";
import { SliceLines } from "./mesh_cut";
import { PaneView } from "./pane_view";
import { type Plane, letterOf, positionText } from "./plane_frame";
import { drawOverlay } from "./slice_overlay";
import { type Patch, sampleLabels, sampleVolume } from "./sampling";
import type { SliceScene } from "./slice_scene";

const MAX_PIXEL_RATIO = 2;
/** While slices move, a slice that takes longer is drawn with half as many pixels along each axis. */
const SLOW_MS = 12;
const SETTLE_MS = 150;
const LABEL_OPACITY = 0.5;
const NAMES: Record<Plane, string> = { axial: "Axial", coronal: "Coronal", sagittal: "Sagittal" };

/** Slices of one plane. */
export class SlicePane extends PaneView {
  readonly element: HTMLElement;
  /** Takes pointers and keys. */
  readonly surface: HTMLElement;
  /** The position of the slice. */
  readonly slider: HTMLInputElement;

  private readonly image = el("canvas");
  private readonly overlay = el("canvas");
  private readonly position = el("span", { class: "slice-position" });
  private readonly letters = ["left", "right", "top", "bottom"].map((edge) => el("span", { class: `letter at-${edge}`, attributes: { "aria-hidden": "true" } }));
  private values = new Int16Array();
  private labels = new Uint16Array();
  private readonly lines = new SliceLines();
  /** What the picture shows: it is not drawn again where nothing of this has changed. */
  private drawn: readonly unknown[] = [];
  private settling: ReturnType<typeof setTimeout> | undefined;
  private isMoving = false;
  private fullMs = 0;
  private isFitted = false;

  constructor(
    plane: Plane,
    scene: SliceScene,
    onSlide: (mm: number) => void,
  ) {
    super(plane, scene);
    this.surface = el("div", { class: "slice-surface", attributes: { tabindex: "0", role: "application", "aria-roledescription": "slice" } }, [this.image, this.overlay, this.position, ...this.letters]);
    const attributes = { type: "range", step: "0.1", "aria-label": `${NAMES[plane]} position` };
    this.slider = el("input", { attributes, on: { input: () => onSlide(this.slider.valueAsNumber) } });
    this.element = el("div", { class: "slice-pane", attributes: { "data-plane": plane } }, [this.surface, this.slider]);
  }

  /** The pane has another size, 0 where a narrow screen shows another pane. It is asked only here: asking makes the browser compute its layout. */
  resize(): void {
    this.width = this.surface.clientWidth;
    this.height = this.surface.clientHeight;
    if (!this.isFitted) this.fit();
  }

  /** All of the volume or the outlines is in the pane. */
  fit(): void {
    this.isFitted = false;
    const bounds = this.scene.bounds;
    if (bounds === null || this.width === 0) return;
    this.middle = scaled(add(bounds.low, bounds.high), 0.5);
    const half = scaled(subtract(bounds.high, bounds.low), 0.5);
    const reach = (axis: Vector) => axis.reduce((sum, entry, k) => sum + Math.abs(entry) * half[k], 0);
    this.mmPerPixel = 1.04 * Math.max((2 * reach(this.frame.right)) / this.width, (2 * reach(this.frame.down)) / this.height);
    const at = dot(this.middle, this.frame.normal);
    const far = reach(this.frame.normal);
    this.slider.min = (at - far).toFixed(1);
    this.slider.max = (at + far).toFixed(1);
    this.isFitted = true;
  }

  /** Where slices move fast, a coarse slice comes first and a fine one when they rest. */
  draw(): void {
    if (this.width === 0 || this.height === 0) return;
    this.showTexts();
    this.isMoving = this.fullMs > SLOW_MS;
    this.drawImage();
    drawOverlay(this.overlay, this, this.scene, this.lines);
    clearTimeout(this.settling);
    if (this.isMoving) this.settling = setTimeout(() => this.settle(), SETTLE_MS);
  }

  dispose(): void {
    clearTimeout(this.settling);
  }

  private settle(): void {
    this.isMoving = false;
    this.drawImage();
  }

  private showTexts(): void {
    const { right, down, normal } = this.frame;
    const text = positionText(normal, this.positionMm);
    this.position.textContent = `${NAMES[this.plane]}  ${text}`;
    this.surface.setAttribute("aria-label", `${NAMES[this.plane]} slice, ${text}`);
    this.slider.value = this.positionMm.toFixed(1);
    this.slider.setAttribute("aria-valuetext", text);
    [scaled(right, -1), right, scaled(down, -1), down].forEach((direction, edge) => (this.letters[edge].textContent = letterOf(direction)));
  }

  private drawImage(): void {
    const ratio = Math.min(MAX_PIXEL_RATIO, devicePixelRatio) * (this.isMoving ? 0.5 : 1);
    const patch = this.patch(ratio);
    const { volume, labels, labelRgb, grayTable } = this.scene;
    const place = [...patch.origin, ...patch.right, ...patch.down].map((number) => number.toFixed(6)).join();
    const shown = [place, patch.width, patch.height, volume, labels, labelRgb, grayTable];
    if (shown.every((part, index) => part === this.drawn[index])) return;
    this.drawn = shown;
    const began = performance.now();
    this.paint(patch);
    if (!this.isMoving) this.fullMs = performance.now() - began;
  }

  private paint(patch: Patch): void {
    const context = this.image.getContext("2d", { alpha: false });
    if (context === null) return;
    if (this.image.width !== patch.width) this.image.width = patch.width;
    if (this.image.height !== patch.height) this.image.height = patch.height;
    const picture = context.createImageData(patch.width, patch.height);
    this.fillPixels(patch, new Uint32Array(picture.data.buffer));
    context.putImageData(picture, 0, 0);
  }

  /** `ratio`: pixels of the picture for each of the page. */
  private patch(ratio: number): Patch {
    const [width, height] = [Math.max(1, Math.round(this.width * ratio)), Math.max(1, Math.round(this.height * ratio))];
    const pixelMm = this.mmPerPixel / ratio;
    return { origin: this.toPoint(0.5 / ratio, 0.5 / ratio), right: scaled(this.frame.right, pixelMm), down: scaled(this.frame.down, pixelMm), width, height };
  }

  private fillPixels(patch: Patch, pixels: Uint32Array): void {
    const { volume, labels, grayTable } = this.scene;
    pixels.fill(0xff000000);
    if (volume !== null) {
      if (this.values.length < pixels.length) this.values = new Int16Array(pixels.length);
      sampleVolume(volume, patch, this.values);
      for (let i = 0; i < pixels.length; ++i) pixels[i] = 0xff000000 | (0x010101 * grayTable[this.values[i] + 32768]);
    }
    if (labels === null) return;
    if (this.labels.length < pixels.length) this.labels = new Uint16Array(pixels.length);
    sampleLabels(labels, patch, this.labels);
    blend(pixels, this.labels, this.scene.labelRgb);
  }
}

/** `rgb`: of each label, red in the lowest byte; -1 is not drawn. */
function blend(pixels: Uint32Array, labels: Uint16Array, rgb: Int32Array): void {
  for (let i = 0; i < pixels.length; ++i) {
    const color = labels[i] < rgb.length ? rgb[labels[i]] : -1;
    if (color < 0) continue;
    const gray = pixels[i] & 0xff;
    const mixed = (shift: number) => Math.round(gray + LABEL_OPACITY * (((color >> shift) & 0xff) - gray)) << shift;
    pixels[i] = 0xff000000 | mixed(16) | mixed(8) | mixed(0);
  }
}
