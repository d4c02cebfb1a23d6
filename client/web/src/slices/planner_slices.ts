// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { messageOf } from "../calls/call_error";
import { throttleToFrame } from "../panels/dom";
import { apply } from "../geometry/rotation";
import { tetBoundary } from "../geometry/tet_boundary";
import type { DrawnSurface } from "../scene/head";
import { cssColor, segmentColor } from "../scene/materials";
import type { Workbench } from "../workbench/workbench";
import { ctDrop } from "./ct_drop";
import { type Outline, SliceViews } from "./slice_views";

const SKIN_COLOR = "#ffb59a";
const BEFORE_COLOR = "#9fc4ff";
const BONE_COLOR = "#efe6cf";
const MESH_COLOR = "#8fe08f";
const TEETH_COLOR = "#ffffff";

/** The slices of a plan: the surfaces of the case, pre-op dashed, post-op as the stage shows them. Axes are those of the head frame. */
export class PlannerSlices {
  readonly views = new SliceViews({});
  private fixed: readonly Outline[];
  private readonly moving: DrawnSurface[];
  private readonly update = throttleToFrame(() => this.refresh());

  constructor(private readonly bench: Workbench) {
    const { left, posterior, superior } = bench.file.manifest.headFrame;
    this.views.setAxes([left, posterior, superior]);
    const { surfaces } = bench.view.head;
    this.moving = surfaces.filter(({ source }) => source.follows !== null || source.entry.handle !== "");
    this.fixed = [...surfaces.filter((surface) => !this.moving.includes(surface)).map(fixedOutline), ...this.moving.map(restOutline)];
    bench.shown.watch(this.update);
    this.refresh();
    const middle = bench.view.head.segmentMiddle(bench.file.manifest.handles[bench.selected.value].name);
    if (middle !== null) this.views.setCrosshair(middle);
    void this.showMesh();
    this.views.addControl(ctDrop(bench, this.views.element));
    bench.volume.watch((volume) => this.views.setVolume(volume));
  }

  /** Call it when the slices are shown again: while they are hidden nothing is computed. */
  refresh(): void {
    if (this.views.element.hidden) return;
    this.views.setOutlines([...this.fixed, ...this.moving.map((surface) => this.movedOutline(surface))]);
  }

  /** The boundary of the tet mesh at rest, which the case's surfaces do not have. */
  private async showMesh(): Promise<void> {
    const { meshSource, meshPayload, manifest, restPositions } = this.bench.file;
    const { vertexCount, tetCount } = manifest.mesh;
    try {
      const bytes = await meshSource.read(meshPayload.offset + 24 * vertexCount, 16 * tetCount);
      const triangles = tetBoundary(new Int32Array(bytes.slice().buffer), vertexCount);
      this.fixed = [...this.fixed, { name: "Mesh, pre-op", color: MESH_COLOR, isOptional: true, positions: restPositions, triangles }];
      this.refresh();
    } catch (thrown) {
      this.bench.notice.value = `The slices show no outline of the mesh: ${messageOf(thrown)}`;
    }
  }

  private movedOutline({ source, shape, mesh }: DrawnSurface): Outline {
    const { handle } = source.entry;
    if (handle === "") return { name: "Skin, post-op", color: SKIN_COLOR, positions: shape.positions, triangles: source.triangles };
    const { handles } = this.bench.file.manifest;
    const index = handles.findIndex((other) => other.name === handle);
    const positions = transformed(source.positions, mesh.matrix.elements);
    return { name: handles[index].label, color: cssColor(segmentColor(index)), positions, triangles: source.triangles };
  }
}

function fixedOutline({ source: { entry, positions, triangles } }: DrawnSurface): Outline {
  const name = entry.kind === "teeth" ? "Teeth" : "Bone";
  return { name, color: entry.kind === "teeth" ? TEETH_COLOR : BONE_COLOR, positions, triangles };
}

function restOutline({ source: { positions, triangles } }: DrawnSurface): Outline {
  return { name: "Pre-op", color: BEFORE_COLOR, dashed: true, positions, triangles };
}

/** `columns`: a matrix of 4 by 4, column after column. */
function transformed(positions: Float32Array, columns: readonly number[]): Float32Array {
  const [a, b, c, , d, e, f, , g, h, i, , x, y, z] = columns;
  const moved = new Float32Array(positions.length);
  for (let k = 0; k < positions.length; k += 3) {
    const [u, v, w] = apply([a, d, g, b, e, h, c, f, i], [positions[k], positions[k + 1], positions[k + 2]]);
    moved[k] = u + x;
    moved[k + 1] = v + y;
    moved[k + 2] = w + z;
  }
  return moved;
}
