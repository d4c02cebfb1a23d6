// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type * as three from "three";
import type { Cut, Head } from "./head";
import { type PictureSize, Stage, type StageListener } from "./stage";
import { type ViewName, viewDirection } from "./views";

/** A head, and the element over which it is drawn. */
export interface HeadPane {
  readonly head: Head;
  readonly element: HTMLElement;
}

/**
 * Heads side by side that one camera looks at, on one canvas behind the panes, which all have one size. The graphics card holds
 * something from `open` to `close` only.
 */
export class HeadPanes {
  private panes: readonly HeadPane[] = [];
  private opened: Stage | null = null;
  private opacity = 1;
  private hasGhost = false;
  private cut: Cut | null = null;

  constructor(
    private readonly container: HTMLElement,
    private readonly listener: StageListener,
  ) {}

  /** Of the first pane: all are of one case. There is at least one pane. */
  get head(): Head {
    return this.panes[0].head;
  }

  /** REQUIRES: open. */
  get stage(): Stage {
    if (this.opened === null) throw new Error("the panes are closed");
    return this.opened;
  }

  get isOpen(): boolean {
    return this.opened !== null;
  }

  /** A head that is not among them is freed. */
  setPanes(panes: readonly HeadPane[]): void {
    for (const { head } of this.panes.filter((pane) => !panes.includes(pane))) {
      head.group.removeFromParent();
      head.dispose();
    }
    this.panes = panes;
    this.dress();
    this.opened?.resize();
  }

  /** `from`: where the camera is, seen from the middle of the head. */
  open(from: three.Vector3): void {
    this.opened = new Stage(this.container, this.listener, { size: () => this.size, draw: (renderer, scene, camera) => this.draw(renderer, scene, camera) });
    this.dress();
    this.opened.look(from, this.head.reach(from));
  }

  close(): void {
    this.panes.forEach(({ head }) => {
      head.group.removeFromParent();
      head.dispose();
    });
    this.opened?.dispose();
    this.opened = null;
  }

  invalidate(): void {
    this.opened?.invalidate();
  }

  look(view: ViewName): void {
    const direction = viewDirection(view);
    this.opened?.look(direction, this.head.reach(direction));
  }

  setSkinOpacity(opacity: number): void {
    this.opacity = opacity;
    this.dress();
  }

  setGhost(isVisible: boolean): void {
    this.hasGhost = isVisible;
    this.dress();
  }

  setCut(cut: Cut | null): void {
    this.cut = cut;
    this.dress();
  }

  /** The pane at a point of the page; -1 where none is. */
  paneAt(x: number, y: number): number {
    return this.panes.findIndex(({ element }) => {
      const { left, right, top, bottom } = element.getBoundingClientRect();
      return x >= left && x < right && y >= top && y < bottom;
    });
  }

  /** All heads look alike. */
  private dress(): void {
    for (const { head } of this.panes) {
      head.setSkinOpacity(this.opacity);
      head.setGhost(this.hasGhost);
      head.setCut(this.cut);
      this.opened?.scene.add(head.group);
    }
    this.invalidate();
  }

  private get size(): PictureSize {
    const element = this.panes[0]?.element;
    return { width: element?.clientWidth ?? 0, height: element?.clientHeight ?? 0 };
  }

  private draw(renderer: three.WebGLRenderer, scene: three.Scene, camera: three.Camera): void {
    const whole = this.container.getBoundingClientRect();
    renderer.setScissorTest(false);
    renderer.clear();
    renderer.setScissorTest(true);
    for (const pane of this.panes) {
      const { left, bottom, width, height } = pane.element.getBoundingClientRect();
      this.panes.forEach((other) => (other.head.group.visible = other === pane));
      renderer.setViewport(left - whole.left, whole.bottom - bottom, width, height);
      renderer.setScissor(left - whole.left, whole.bottom - bottom, width, height);
      renderer.render(scene, camera);
    }
  }
}
