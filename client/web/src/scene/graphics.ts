// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import * as three from "three";

/** The browser restores a context within some frames, or not at all. */
const RESTORE_MS = 1500;
const NOT_BACK = "The browser does not restore the graphics card, so there is no picture: reload the page";

/** How a camera's picture is put onto the canvas where it is drawn more than once. */
export type DrawPanes = (renderer: three.WebGLRenderer, scene: three.Scene, camera: three.Camera) => void;

/**
 * The renderer and the canvas that it draws on, which the browser may take away at any time. The canvas fills `surface`; what listens
 * to pointers and keys listens to `surface`, because a lost canvas may be replaced.
 */
export class Graphics {
  /** Null where the browser has no WebGL. */
  renderer: three.WebGLRenderer | null;
  canvas: HTMLCanvasElement;

  private lossExtension: WEBGL_lose_context | null = null;
  /** The browser has reported the loss; it restores no context before that. */
  private isReported = false;
  private restoring: Promise<void> | null = null;
  private whenBack: (() => void)[] = [];
  private frame = { width: 1, height: 1, pixelRatio: 1 };

  /** `onContext`: the context was lost, or is back. `drawPanes`: null draws once over all of the canvas. */
  constructor(
    private readonly surface: HTMLElement,
    private readonly onContext: (isLost: boolean) => void,
    private readonly drawPanes: DrawPanes | null = null,
  ) {
    this.canvas = document.createElement("canvas");
    this.renderer = createRenderer(this.canvas);
    this.take(this.canvas);
  }

  get isLost(): boolean {
    return this.renderer !== null && this.renderer.getContext().isContextLost();
  }

  /** In pixels of the page, each of which is so many of the canvas. */
  setFrame(width: number, height: number, pixelRatio: number): void {
    this.frame = { width, height, pixelRatio };
    this.renderer?.setPixelRatio(pixelRatio);
    this.renderer?.setSize(width, height);
  }

  /** False where nothing was drawn. */
  render(scene: three.Scene, camera: three.Camera): boolean {
    if (this.renderer === null || this.isLost) return false;
    if (this.drawPanes === null) this.renderer.render(scene, camera);
    else this.drawPanes(this.renderer, scene, camera);
    return !this.isLost;
  }

  /** What `render` would draw, of this size, as a canvas of its own; null where nothing was drawn. What is on the page is drawn over. */
  draw(scene: three.Scene, camera: three.Camera, width: number, height: number): HTMLCanvasElement | null {
    if (this.renderer === null) return null;
    const copy = document.createElement("canvas");
    [copy.width, copy.height] = [width, height];
    this.renderer.setPixelRatio(1);
    this.renderer.setSize(width, height, false);
    this.render(scene, camera);
    copy.getContext("2d")?.drawImage(this.canvas, 0, 0);
    this.finish();
    this.setFrame(this.frame.width, this.frame.height, this.frame.pixelRatio);
    return this.isLost ? null : copy;
  }

  /** Waits for the graphics card: a loss that happened while it drew is known after this. */
  finish(): void {
    const context = this.renderer?.getContext();
    context?.readPixels(0, 0, 1, 1, context.RGBA, context.UNSIGNED_BYTE, new Uint8Array(4));
  }

  /** Resolves at once where nothing is lost; rejects with an Error where the browser gives no context. */
  restore(): Promise<void> {
    if (!this.isLost) return Promise.resolve();
    this.restoring ??= this.bringBack().finally(() => (this.restoring = null));
    return this.restoring;
  }

  /** Frees the context at once: browsers take the oldest one away where a page has many. Nothing is drawn afterwards. */
  dispose(): void {
    const { renderer } = this;
    this.renderer = null;
    renderer?.dispose();
    renderer?.forceContextLoss();
  }

  private async bringBack(): Promise<void> {
    const isBack = new Promise<boolean>((resolve) => {
      this.whenBack.push(() => resolve(true));
      setTimeout(() => resolve(false), RESTORE_MS);
    });
    if (this.isReported) this.endLoss();
    if (!(await isBack) && this.isLost) this.replace();
  }

  /** Where the extension caused the loss; after any other this does nothing, and the browser may restore by itself. */
  private endLoss(): void {
    this.lossExtension?.restoreContext();
  }

  private replace(): void {
    const canvas = document.createElement("canvas");
    const renderer = createRenderer(canvas);
    if (renderer === null) throw new Error(NOT_BACK);
    this.renderer?.dispose();
    this.renderer = renderer;
    this.take(canvas);
    this.setFrame(this.frame.width, this.frame.height, this.frame.pixelRatio);
    this.onContext(false);
  }

  private take(canvas: HTMLCanvasElement): void {
    this.canvas = canvas;
    this.isReported = false;
    this.surface.replaceChildren(canvas);
    // The context gives out its extensions only while it is not lost.
    this.lossExtension = this.renderer?.getContext().getExtension("WEBGL_lose_context") ?? null;
    canvas.addEventListener("webglcontextlost", () => {
      if (canvas !== this.canvas || this.renderer === null) return;
      this.isReported = true;
      // The browser restores a context only after every listener has heard of the loss.
      if (this.restoring !== null) setTimeout(() => this.endLoss());
      this.onContext(true);
    });
    canvas.addEventListener("webglcontextrestored", () => {
      if (canvas !== this.canvas) return;
      this.isReported = false;
      this.whenBack.splice(0).forEach((resume) => resume());
      this.onContext(false);
    });
  }
}

function createRenderer(canvas: HTMLCanvasElement): three.WebGLRenderer | null {
  try {
    const renderer = new three.WebGLRenderer({ canvas, antialias: true, alpha: true });
    renderer.localClippingEnabled = true;
    renderer.toneMapping = three.NeutralToneMapping;
    return renderer;
  } catch {
    return null;
  }
}
