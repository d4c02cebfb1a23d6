// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import * as three from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { type DrawPanes, Graphics } from "./graphics";

const FIELD_OF_VIEW_DEG = 22;
/** Of half the field of view. */
export const TANGENT = Math.tan((FIELD_OF_VIEW_DEG * Math.PI) / 360);
/** Around what is looked at stays a little room. */
const MARGIN = 1.08;
const MOST_PIXEL_RATIO = 2;
/** A graphics card that is taken away again and again is not waited for without end. */
const MOST_ATTEMPTS = 3;
const LOST_AGAIN = "The browser repeatedly loses the graphics card, so no picture was made: close other pages with 3D pictures and try again";

/** What a stage reports to its owner. */
export interface StageListener {
  /** The camera or the size changed, or something was redrawn. */
  onDrawn(): void;
  /** The browser took the graphics card away, or gave it back. */
  onContext(isLost: boolean): void;
}

/** From how far away a square picture has all of the height, and all of the width, of what is looked at, in mm. */
export interface Reach {
  height: number;
  width: number;
}

/** In pixels. */
export interface PictureSize {
  width: number;
  height: number;
}

/** Several pictures by one camera, side by side on one canvas. */
export interface Panes {
  /** Of each of them, in pixels of the page. */
  size(): PictureSize;
  draw: DrawPanes;
}

/**
 * The picture: camera, lights, orbit. It is drawn only when something asks for it by `invalidate`. Where the browser has no WebGL
 * there is no renderer; everything else works.
 *
 * World axes: x to the patient's left, y up, z forward, in mm about the head's middle.
 */
export class Stage {
  readonly scene = new three.Scene();
  readonly camera = new three.PerspectiveCamera(FIELD_OF_VIEW_DEG, 1, 1, 5000);
  /** Takes pointers and keys; the picture fills it. */
  readonly surface: HTMLElement;
  readonly controls: OrbitControls;
  /** How often was drawn. */
  drawnCount = 0;

  private isWaiting = false;
  private isDrawing = true;
  private afterDrawing: (() => void)[] = [];
  /** Of what is looked at: width by height. */
  private span = 1;
  private readonly graphics: Graphics;
  private readonly keyLight = new three.DirectionalLight(0xfff6ee, 2.0);
  private readonly resizes = new ResizeObserver(() => this.resize());

  /** `panes`: null shows one picture, which fills `container`. */
  constructor(
    private readonly container: HTMLElement,
    private readonly listener: StageListener,
    private readonly panes: Panes | null = null,
  ) {
    this.surface = document.createElement("div");
    this.surface.className = "surface";
    this.surface.tabIndex = 0;
    container.append(this.surface);
    this.graphics = new Graphics(this.surface, (isLost) => {
      this.listener.onContext(isLost);
      this.invalidate();
    }, panes?.draw);
    this.controls = new OrbitControls(this.camera, this.surface);
    this.controls.enableDamping = false;
    this.controls.minDistance = 60;
    this.controls.maxDistance = 3000;
    this.controls.addEventListener("change", () => this.invalidate());
    this.addLights();
    this.resizes.observe(container);
    this.resize();
  }

  /** Null where the browser has no WebGL. */
  get renderer(): three.WebGLRenderer | null {
    return this.graphics.renderer;
  }

  get hasRenderer(): boolean {
    return this.renderer !== null;
  }

  /** Brings a lost picture back; rejects with an Error where the browser gives no graphics card. */
  restore(): Promise<void> {
    return this.graphics.restore();
  }

  /** Draws before the browser's next picture; then calls `then`. */
  invalidate(then?: () => void): void {
    if (then !== undefined) this.afterDrawing.push(then);
    if (!this.isDrawing || this.renderer === null) {
      this.reportDrawn();
      return;
    }
    if (this.isWaiting) return;
    this.isWaiting = true;
    requestAnimationFrame(() => this.draw());
  }

  /** Draws and waits for the graphics card: how long that took, in ms. */
  drawNow(): number {
    const begin = performance.now();
    this.draw();
    this.graphics.finish();
    return performance.now() - begin;
  }

  /** For measurements: without drawing everything else goes on. */
  setDrawing(isDrawing: boolean): void {
    this.isDrawing = isDrawing;
    this.invalidate();
  }

  /** Millimetres that a pixel shows in the plane of the orbit's middle. */
  get millimetresPerPixel(): number {
    const height = 2 * this.camera.position.distanceTo(this.controls.target) * TANGENT;
    return height / Math.max(1, (this.panes?.size() ?? { height: this.container.clientHeight }).height);
  }

  /** Looks from `direction` at the middle, from where all of this reach is within the picture. */
  look(direction: three.Vector3, { height, width }: Reach): void {
    this.span = width / height;
    this.controls.target.set(0, 0, 0);
    this.camera.position.copy(direction).setLength((MARGIN * height) / this.fit);
    this.controls.update();
    this.invalidate();
  }

  /** Turns about the middle, as the keyboard does it. */
  orbit(leftRadians: number, upRadians: number): void {
    const offset = this.camera.position.clone().sub(this.controls.target);
    const spherical = new three.Spherical().setFromVector3(offset);
    spherical.theta += leftRadians;
    spherical.phi -= upRadians;
    spherical.makeSafe();
    this.camera.position.copy(this.controls.target).add(new three.Vector3().setFromSpherical(spherical));
    this.controls.update();
    this.invalidate();
  }

  zoom(factor: number): void {
    const offset = this.camera.position.clone().sub(this.controls.target).multiplyScalar(factor);
    this.camera.position.copy(this.controls.target).add(offset);
    this.controls.update();
    this.invalidate();
  }

  /**
   * The picture as it is now, of this size in pixels or as large as on the page; null where the browser has no WebGL. `arrange` sets
   * up what this picture alone has, but the camera, and returns what takes that back. Waits for a graphics card that was taken away;
   * rejects with an Error where it does not come back.
   */
  async snapshot(size: PictureSize | null = null, arrange: () => () => void = () => () => {}): Promise<HTMLCanvasElement | null> {
    if (!this.hasRenderer) return null;
    for (let attempt = 0; attempt < MOST_ATTEMPTS; ++attempt) {
      await this.restore();
      const picture = this.drawApart(size ?? this.graphics.canvas, arrange);
      if (picture !== null) return picture;
    }
    throw new Error(LOST_AGAIN);
  }

  /** The camera is where it was afterwards. */
  private drawApart({ width, height }: PictureSize, arrange: () => () => void): HTMLCanvasElement | null {
    const [position, target, { aspect }, span] = [this.camera.position.clone(), this.controls.target.clone(), this.camera, this.span];
    this.setAspect(width / height);
    const takeBack = arrange();
    this.light();
    const picture = this.graphics.draw(this.scene, this.camera, width, height);
    takeBack();
    this.span = span;
    this.setAspect(aspect);
    this.camera.position.copy(position);
    this.controls.target.copy(target);
    this.controls.update();
    this.invalidate();
    return picture;
  }

  private draw(): void {
    this.isWaiting = false;
    if (this.isDrawing) {
      this.light();
      if (this.graphics.render(this.scene, this.camera)) this.drawnCount += 1;
    }
    this.reportDrawn();
  }

  /** The key light comes from above the viewer's left shoulder, wherever the viewer is. */
  private light(): void {
    this.keyLight.position.set(-0.55, 0.75, 1).applyQuaternion(this.camera.quaternion);
  }

  private reportDrawn(): void {
    const then = this.afterDrawing;
    this.afterDrawing = [];
    then.forEach((call) => call());
    this.listener.onDrawn();
  }

  private addLights(): void {
    const fill = new three.DirectionalLight(0xe6edff, 0.8);
    fill.position.set(1, 0.1, 0.6);
    const rim = new three.DirectionalLight(0xffffff, 0.5);
    rim.position.set(-0.4, 0.5, -1);
    this.scene.add(new three.HemisphereLight(0xf9fafc, 0x8a766c, 1.25), this.keyLight, fill, rim);
  }

  /** Below 1 where the picture is narrower than what is looked at: which part of the width it would have from the distance for the height. */
  private get fit(): number {
    return Math.min(1, this.camera.aspect / this.span);
  }

  /** A picture that is too narrow is looked at from further away, so that it shows what a wider one does. */
  private setAspect(aspect: number): void {
    const before = this.fit;
    this.camera.aspect = aspect;
    this.camera.updateProjectionMatrix();
    if (this.fit !== before) this.zoom(before / this.fit);
  }

  /** Frees the graphics card; the stage is of no use afterwards. */
  dispose(): void {
    this.resizes.disconnect();
    this.controls.dispose();
    this.graphics.dispose();
    this.surface.remove();
  }

  /** Call it when panes are laid out differently; the container's own size is watched. */
  resize(): void {
    const { clientWidth, clientHeight } = this.container;
    const { width, height } = this.panes?.size() ?? { width: clientWidth, height: clientHeight };
    // While another page lies over this one it has no size, and keeps the one that it had.
    if (width === 0 || height === 0) return;
    this.setAspect(width / height);
    // Controls measure by the height of the surface, which holds all panes.
    this.controls.rotateSpeed = this.controls.panSpeed = clientHeight / height;
    this.graphics.setFrame(clientWidth, clientHeight, Math.min(MOST_PIXEL_RATIO, devicePixelRatio));
    this.invalidate();
  }
}
