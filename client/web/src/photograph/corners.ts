// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { pointTriangles, type Photograph } from "../movingdata/photograph_data";
import { bounds } from "./triangle_grid";

/** Triangles that share nothing: each has three corners of its own. */
export interface Corners {
  /** #T by 9. */
  positions: Float32Array<ArrayBuffer>;
  /** #T by 6; null: none. */
  uv: Float32Array<ArrayBuffer> | null;
  /** #T by 9, sRGB; null: none. */
  colors: Uint8Array<ArrayBuffer> | null;
}

/** Corners at the same place become one point; those with the same texture and color one drawn vertex. Triangles without an area are dropped. */
export function joinCorners({ positions, uv, colors }: Corners, image: Photograph["image"]): Photograph {
  const count = positions.length / 3;
  const isTextured = uv !== null && image !== null;
  const shown = { uv: isTextured ? uv : null, colors: isTextured ? null : colors };
  const points = new Numbering<string>();
  const vertices = new Numbering<string>();
  const corners = new Uint32Array(count);
  for (let c = 0; c < count; ++c) {
    const point = points.of(`${positions[3 * c]} ${positions[3 * c + 1]} ${positions[3 * c + 2]}`, c);
    const look = shown.uv !== null ? `${shown.uv[2 * c]} ${shown.uv[2 * c + 1]}` : shown.colors === null ? "" : shown.colors.subarray(3 * c, 3 * c + 3).join(" ");
    corners[c] = vertices.of(`${point} ${look}`, c);
  }
  const pointOf = new Map(points.first.map((c, point) => [`${positions[3 * c]} ${positions[3 * c + 1]} ${positions[3 * c + 2]}`, point]));
  const drawn = Uint32Array.from(vertices.first, (c) => pointOf.get(`${positions[3 * c]} ${positions[3 * c + 1]} ${positions[3 * c + 2]}`) ?? 0);
  return {
    positions: rows(positions, points.first, 3, (n) => new Float32Array(n)),
    drawn,
    triangles: withArea(corners, drawn),
    uv: shown.uv === null ? null : rows(shown.uv, vertices.first, 2, (n) => new Float32Array(n)),
    colors: shown.colors === null ? null : rows(shown.colors, vertices.first, 3, (n) => new Uint8Array(n)),
    image: isTextured ? image : null,
  };
}

/** Fewer triangles: points within a cube become their mean. Seams of the texture stay closed and keep both sides. */
export function reduce(photograph: Photograph, most: number): Photograph {
  let reduced = photograph;
  const [low, high] = bounds(photograph.positions);
  // Each point has about two triangles, and a surface crosses about (size / cell)^2 cubes.
  let cell = Math.max(...high.map((value, k) => value - low[k])) / Math.sqrt(most);
  for (; reduced.triangles.length / 3 > most; cell *= 1.2) reduced = clustered(photograph, low, cell);
  return reduced;
}

/** Texture coordinates that differ by more than this are on two sides of a seam. */
const SEAM_UV = 1 / 16;

function clustered({ positions, drawn, triangles, uv, colors, image }: Photograph, low: readonly number[], cell: number): Photograph {
  const points = new Numbering<string>();
  const clusterOf = new Uint32Array(positions.length / 3);
  for (let v = 0; v < clusterOf.length; ++v) clusterOf[v] = points.of([0, 1, 2].map((k) => Math.floor((positions[3 * v + k] - low[k]) / cell)).join(" "), v);
  const vertices = new Numbering<string>();
  const vertexOf = drawn.map((point, d) => vertices.of(`${clusterOf[point]} ${uv === null ? "" : `${Math.floor(uv[2 * d] / SEAM_UV)} ${Math.floor(uv[2 * d + 1] / SEAM_UV)}`}`, d));
  const kept = Uint32Array.from(vertices.first, (d) => clusterOf[drawn[d]]);
  const corners = triangles.map((d) => vertexOf[d]);
  return {
    positions: means(positions, clusterOf, points.first.length, 3),
    drawn: kept,
    triangles: withArea(corners, kept),
    uv: uv === null ? null : means(uv, vertexOf, vertices.first.length, 2),
    colors: colors === null ? null : Uint8Array.from(means(Float32Array.from(colors), vertexOf, vertices.first.length, 3)),
    image,
  };
}

/** Gives each key a number, in the order in which they come. */
class Numbering<K> {
  /** What each key came with first. */
  readonly first: number[] = [];
  private readonly numbers = new Map<K, number>();

  of(key: K, from: number): number {
    const known = this.numbers.get(key);
    if (known !== undefined) return known;
    this.numbers.set(key, this.first.length);
    return this.first.push(from) - 1;
  }
}

function withArea(corners: Uint32Array, drawn: Uint32Array): Uint32Array<ArrayBuffer> {
  const points = pointTriangles({ triangles: corners as Uint32Array<ArrayBuffer>, drawn: drawn as Uint32Array<ArrayBuffer> });
  const kept: number[] = [];
  for (let t = 0; t < points.length; t += 3) {
    const isDegenerate = points[t] === points[t + 1] || points[t + 1] === points[t + 2] || points[t] === points[t + 2];
    if (!isDegenerate) kept.push(corners[t], corners[t + 1], corners[t + 2]);
  }
  return Uint32Array.from(kept);
}

function rows<A extends Float32Array | Uint8Array>(source: A, from: readonly number[], width: number, make: (length: number) => A): A {
  const out = make(width * from.length);
  from.forEach((row, i) => {
    for (let k = 0; k < width; ++k) out[width * i + k] = source[width * row + k];
  });
  return out;
}

function means(source: Float32Array, group: ArrayLike<number>, count: number, width: number): Float32Array<ArrayBuffer> {
  const out = new Float32Array(width * count);
  const members = new Uint32Array(count);
  for (let i = 0; i < group.length; ++i) {
    members[group[i]] += 1;
    for (let k = 0; k < width; ++k) out[width * group[i] + k] += source[width * i + k];
  }
  return out.map((sum, i) => sum / members[Math.floor(i / width)]);
}
