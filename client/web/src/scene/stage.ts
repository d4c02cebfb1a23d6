// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import * as three from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";

const FIELD_OF_VIEW_DEG = 22;
const MOST_PIXEL_RATIO = 2;

/** What a stage tells its owner. */
export interface StageListener {
  /** The camera or the size changed, or something was drawn anew. */
  onDrawn(): void;
  /** The browser took the graphics card away, or gave it back. */
  onContext(isLost: boolean): void;
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
  readonly canvas: HTMLCanvasElement;
  readonly controls: OrbitControls;
  readonly renderer: three.WebGLRenderer | null;
  /** How often was drawn. */
  drawnCount = 0;

  private isWaiting = false;
  private isDrawing = true;
  private afterDrawing: (() => void)[] = [];
  private readonly keyLight = new three.DirectionalLight(0xfff6ee, 2.0);

  constructor(
    private readonly container: HTMLElement,
    private readonly listener: StageListener,
  ) {
    this.canvas = document.createElement("canvas");
    this.canvas.tabIndex = 0;
    container.append(this.canvas);
    this.renderer = createRenderer(this.canvas);
    this.controls = new OrbitControls(this.camera, this.canvas);
    this.controls.enableDamping = false;
    this.controls.minDistance = 60;
    this.controls.maxDistance = 3000;
    this.controls.addEventListener("change", () => this.invalidate());
    this.addLights();
    new ResizeObserver(() => this.resize()).observe(container);
    this.canvas.addEventListener("webglcontextlost", () => this.listener.onContext(true));
    this.canvas.addEventListener("webglcontextrestored", () => {
      this.listener.onContext(false);
      this.invalidate();
    });
    this.resize();
  }

  get hasRenderer(): boolean {
    return this.renderer !== null;
  }

  /** Draws before the browser's next picture; then tells `then`. */
  invalidate(then?: () => void): void {
    if (then !== undefined) this.afterDrawing.push(then);
    if (!this.isDrawing || this.renderer === null) {
      this.tellDrawn();
      return;
    }
    if (this.isWaiting) return;
    this.isWaiting = true;
    requestAnimationFrame(() => this.draw());
  }

  /** For measurements: without drawing everything else goes on. */
  setDrawing(isDrawing: boolean): void {
    this.isDrawing = isDrawing;
    this.invalidate();
  }

  /** Millimetres that a pixel shows in the plane of the orbit's middle. */
  get millimetresPerPixel(): number {
    const height = 2 * this.camera.position.distanceTo(this.controls.target) * Math.tan((FIELD_OF_VIEW_DEG * Math.PI) / 360);
    return height / Math.max(1, this.container.clientHeight);
  }

  /** Looks from `direction` at the whole of what has this radius about the middle. */
  look(direction: three.Vector3, radius: number): void {
    const fit = Math.min(1, this.camera.aspect);
    const distance = radius / Math.sin((FIELD_OF_VIEW_DEG * Math.PI) / 360) / fit;
    this.controls.target.set(0, 0, 0);
    this.camera.position.copy(direction).setLength(distance);
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

  /** The picture as it is now, or null where nothing can be drawn. */
  snapshot(): HTMLCanvasElement | null {
    if (this.renderer === null) return null;
    this.renderer.render(this.scene, this.camera);
    return this.canvas;
  }

  private draw(): void {
    this.isWaiting = false;
    if (!this.isDrawing || this.renderer === null) return this.tellDrawn();
    // The key light comes from above the viewer's left shoulder, wherever the viewer is.
    this.keyLight.position.set(-0.55, 0.75, 1).applyQuaternion(this.camera.quaternion);
    this.renderer.render(this.scene, this.camera);
    this.drawnCount += 1;
    this.tellDrawn();
  }

  private tellDrawn(): void {
    const then = this.afterDrawing;
    this.afterDrawing = [];
    then.forEach((tell) => tell());
    this.listener.onDrawn();
  }

  private addLights(): void {
    const fill = new three.DirectionalLight(0xe6edff, 0.8);
    fill.position.set(1, 0.1, 0.6);
    const rim = new three.DirectionalLight(0xffffff, 0.5);
    rim.position.set(-0.4, 0.5, -1);
    this.scene.add(new three.HemisphereLight(0xf9fafc, 0x8a766c, 1.25), this.keyLight, fill, rim);
  }

  private resize(): void {
    const width = Math.max(1, this.container.clientWidth);
    const height = Math.max(1, this.container.clientHeight);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.renderer?.setPixelRatio(Math.min(MOST_PIXEL_RATIO, devicePixelRatio));
    this.renderer?.setSize(width, height);
    this.invalidate();
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
