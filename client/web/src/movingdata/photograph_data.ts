// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

/** A 3-D photograph as it was read: no name of a file or a patient. */
export interface Photograph {
  /** #V by 3; each point once, also at a seam of the texture. */
  positions: Float32Array<ArrayBuffer>;
  /** #D: place in `positions` of each drawn vertex. More than #V where the texture has seams. */
  drawn: Uint32Array<ArrayBuffer>;
  /** #T by 3, each below #D. */
  triangles: Uint32Array<ArrayBuffer>;
  /** #D by 2, from the lower left corner of the image; null: shape only, or colors. */
  uv: Float32Array<ArrayBuffer> | null;
  /** #D by 3, sRGB; null without colors. */
  colors: Uint8Array<ArrayBuffer> | null;
  /** A JPEG, PNG or WebP file; null without an image. */
  image: Uint8Array<ArrayBuffer> | null;
}

/** A photograph that was registered: its positions are in LPS, mm, and follow the skin. */
export interface BoundPhotograph extends Photograph {
  /** #V by 3: vertices of the skins, one skin after the other. */
  places: Uint32Array<ArrayBuffer>;
  /** #V by 3, at least 0, at most 1 together. */
  weights: Float32Array<ArrayBuffer>;
  /** #V: mm along the skin's normal, which turns with the skin; 0 where the skin is too far away for that. */
  offsetsMm: Float32Array<ArrayBuffer>;
}

/** The triangles over `positions`: of points that are there once. */
export function pointTriangles({ triangles, drawn }: Pick<Photograph, "triangles" | "drawn">): Uint32Array<ArrayBuffer> {
  return triangles.map((vertex) => drawn[vertex]);
}
