// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Grid } from "../volume/volume";
import { coarserTriangles } from "./coarse_surface";
import { type BoneVoxels, type NearCut, type PieceCut, boneVoxels, cutPieces, cutsNear } from "./pieces";
import type { Plane } from "./recipe";
import { type NetSurface, surfaceNets } from "./surface_nets";

// Makes the preview's surface of bone and says which of it every segment takes, beside the page.

export interface LoadBone {
  readonly kind: "load";
  readonly grid: Grid;
  readonly values: Float32Array;
  readonly threshold: number;
  /** Jaw of each voxel by a label map; null without one. */
  readonly jaws: Uint8Array | null;
  /** Middles of voxels by structure, LPS, mm. */
  readonly structures: ReadonlyMap<string, Float32Array>;
  /** Edge of the label map's voxels. */
  readonly labelMm: number;
}

export interface CutBone {
  readonly kind: "cut";
  readonly number: number;
  readonly cuts: readonly PieceCut[];
  readonly occlusal: Plane | null;
  readonly marginMm: number;
}

export type ToBoneWorker = LoadBone | CutBone;

export interface CutAnswer {
  readonly kind: "pieces";
  readonly number: number;
  /** Of each vertex: 1 for bone that stays, 2, 3, .. for the segments. */
  readonly labels: Uint8Array;
  readonly volumesMm3: readonly number[];
  readonly near: readonly NearCut[];
  /** How long the worker took. */
  readonly ms: number;
}

export interface BoneSurface {
  readonly kind: "surface";
  readonly positions: Float32Array;
  readonly triangles: Uint32Array;
  /** Fewer triangles of the same vertices. */
  readonly coarse: Uint32Array;
}

export type FromBoneWorker = BoneSurface | CutAnswer;

/** Without a graphics card a browser draws so many in less than 0.1 s. */
const MOST_MOVING_TRIANGLES = 25_000;

let loaded: { bone: BoneVoxels; surface: NetSurface; message: LoadBone } | null = null;

function load(message: LoadBone): void {
  const { grid, values, threshold, jaws } = message;
  const surface = surfaceNets(grid, values, threshold);
  loaded = { bone: boneVoxels(grid, values, threshold, jaws), surface, message };
  const { positions, triangles } = surface;
  answer({ kind: "surface", positions, triangles, coarse: coarserTriangles(surface, grid.size, MOST_MOVING_TRIANGLES) });
}

function cut({ number, cuts, occlusal, marginMm }: CutBone): void {
  if (loaded === null) return;
  const begun = performance.now();
  const { labels, volumesMm3 } = cutPieces(loaded.bone, cuts, occlusal);
  const near = cutsNear(cuts, loaded.message.structures, marginMm, loaded.message.labelMm);
  const { voxels } = loaded.surface;
  const ofVertices = new Uint8Array(voxels.length);
  for (let vertex = 0; vertex < voxels.length; ++vertex) ofVertices[vertex] = labels[voxels[vertex]];
  answer({ kind: "pieces", number, labels: ofVertices, volumesMm3, near, ms: performance.now() - begun });
}

function answer(message: FromBoneWorker): void {
  postMessage(message);
}

addEventListener("message", ({ data }: MessageEvent<ToBoneWorker>) => (data.kind === "load" ? load(data) : cut(data)));
