// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Triangles } from "../measures/anchor";

/** What `TriangleGrid.nearest` has found. */
export interface Nearest {
  /** -1: none. */
  triangle: number;
  distanceMm: number;
  /** Of the triangle's corners, 1 together. */
  weights: [number, number, number];
}

const MAX_CELLS = 2_000_000;
/** Of a distance to a plane with a normal of float32. */
const ROUNDING_MM = 1e-4;

/** Finds the nearest triangle of a surface by a grid of cubes. Not for several threads: `nearest` writes its scratch space. */
export class TriangleGrid {
  /** #T by 3, unit length; 0 for a triangle without area. */
  readonly normals: Float32Array;
  private readonly origin: [number, number, number];
  private readonly size: [number, number, number];
  private readonly starts: Uint32Array;
  private readonly entries: Uint32Array;
  private readonly barycentric = new Float64Array(3);

  /** `cellMm`: about two edges of a triangle; larger where the grid would be too large. */
  constructor(
    private readonly surface: Triangles,
    private cellMm = 2.5,
  ) {
    const { positions, triangles } = surface;
    const [low, high] = bounds(positions);
    const cells = (cell: number) => low.map((value, k) => Math.floor((high[k] - value) / cell) + 1);
    while (cells(this.cellMm).reduce((a, b) => a * b) > MAX_CELLS) this.cellMm *= 1.5;
    this.origin = low;
    this.size = cells(this.cellMm) as [number, number, number];
    this.normals = triangleNormals(surface);
    this.starts = new Uint32Array(this.size[0] * this.size[1] * this.size[2] + 1);
    const count = triangles.length / 3;
    for (let t = 0; t < count; ++t) this.visit(t, (cell) => ++this.starts[cell + 1]);
    for (let i = 1; i < this.starts.length; ++i) this.starts[i] += this.starts[i - 1];
    this.entries = new Uint32Array(this.starts[this.starts.length - 1]);
    const next = this.starts.slice();
    for (let t = 0; t < count; ++t) this.visit(t, (cell) => (this.entries[next[cell]++] = t));
  }

  /** The nearest point within `mostMm`. With a `normal` only triangles count that face within about 75 degrees of it. */
  nearest(x: number, y: number, z: number, mostMm: number, normal: ArrayLike<number> | null = null): Nearest {
    const found: Nearest = { triangle: -1, distanceMm: mostMm, weights: [1, 0, 0] };
    const at = [x, y, z].map((value, k) => Math.floor((value - this.origin[k]) / this.cellMm));
    const rings = Math.ceil(mostMm / this.cellMm);
    const nearestRing = Math.max(0, ...at.map((value, k) => Math.max(-value, value - this.size[k] + 1)));
    for (let ring = nearestRing; ring <= rings && (ring - 1) * this.cellMm < found.distanceMm; ++ring) this.lookInRing(at, ring, x, y, z, normal, found);
    return found;
  }

  private lookInRing([ci, cj, ck]: number[], ring: number, x: number, y: number, z: number, normal: ArrayLike<number> | null, found: Nearest): void {
    const [ni, nj, nk] = this.size;
    for (let k = Math.max(0, ck - ring); k <= Math.min(nk - 1, ck + ring); ++k) {
      for (let j = Math.max(0, cj - ring); j <= Math.min(nj - 1, cj + ring); ++j) {
        const isFace = Math.abs(k - ck) === ring || Math.abs(j - cj) === ring;
        const step = isFace || ring === 0 ? 1 : 2 * ring;
        for (let i = ci - ring; i <= ci + ring; i += step) {
          if (i >= 0 && i < ni) this.lookInCell(i + ni * (j + nj * k), x, y, z, normal, found);
        }
      }
    }
  }

  private lookInCell(cell: number, x: number, y: number, z: number, normal: ArrayLike<number> | null, found: Nearest): void {
    const { positions, triangles } = this.surface;
    for (let e = this.starts[cell]; e < this.starts[cell + 1]; ++e) {
      const t = this.entries[e];
      if (normal !== null && normal[0] * this.normals[3 * t] + normal[1] * this.normals[3 * t + 1] + normal[2] * this.normals[3 * t + 2] < 0.25) continue;
      if (this.planeDistance(t, x, y, z) >= found.distanceMm) continue;
      const distance = closest(positions, 3 * triangles[3 * t], 3 * triangles[3 * t + 1], 3 * triangles[3 * t + 2], x, y, z, this.barycentric);
      if (distance >= found.distanceMm) continue;
      found.distanceMm = distance;
      found.triangle = t;
      for (let k = 0; k < 3; ++k) found.weights[k] = this.barycentric[k];
    }
  }

  /** At most the distance to the triangle, and quick: most triangles are rejected by it. */
  private planeDistance(t: number, x: number, y: number, z: number): number {
    const { positions, triangles } = this.surface;
    const { normals } = this;
    const a = 3 * triangles[3 * t];
    const n = 3 * t;
    return Math.abs(normals[n] * (x - positions[a]) + normals[n + 1] * (y - positions[a + 1]) + normals[n + 2] * (z - positions[a + 2])) - ROUNDING_MM;
  }

  /** Cells of the box about a triangle. */
  private visit(t: number, visitor: (cell: number) => void): void {
    const { positions, triangles } = this.surface;
    const [a, b, c] = [3 * triangles[3 * t], 3 * triangles[3 * t + 1], 3 * triangles[3 * t + 2]];
    const cell = (value: number, k: number) => Math.floor((value - this.origin[k]) / this.cellMm);
    const low = [0, 1, 2].map((k) => cell(Math.min(positions[a + k], positions[b + k], positions[c + k]), k));
    const high = [0, 1, 2].map((k) => cell(Math.max(positions[a + k], positions[b + k], positions[c + k]), k));
    for (let k = low[2]; k <= high[2]; ++k) {
      for (let j = low[1]; j <= high[1]; ++j) {
        for (let i = low[0]; i <= high[0]; ++i) visitor(i + this.size[0] * (j + this.size[1] * k));
      }
    }
  }
}

/** The least and the largest of each coordinate. */
export function bounds(positions: ArrayLike<number>): [[number, number, number], [number, number, number]] {
  const [low, high]: [number, number, number][] = [[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]];
  for (let i = 0; i < positions.length; ++i) {
    low[i % 3] = Math.min(low[i % 3], positions[i]);
    high[i % 3] = Math.max(high[i % 3], positions[i]);
  }
  return [low, high];
}

function triangleNormals({ positions, triangles }: Triangles): Float32Array {
  const normals = new Float32Array(triangles.length);
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [3 * triangles[t], 3 * triangles[t + 1], 3 * triangles[t + 2]];
    const [ux, uy, uz] = [positions[b] - positions[a], positions[b + 1] - positions[a + 1], positions[b + 2] - positions[a + 2]];
    const [vx, vy, vz] = [positions[c] - positions[a], positions[c + 1] - positions[a + 1], positions[c + 2] - positions[a + 2]];
    const [x, y, z] = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
    const length = Math.sqrt(x * x + y * y + z * z) || 1;
    normals.set([x / length, y / length, z / length], t);
  }
  return normals;
}

/** Distance to a triangle; `out`: weights of its nearest point. As measures/anchor.ts, without allocations: it runs millions of times. */
function closest(p: ArrayLike<number>, a: number, b: number, c: number, x: number, y: number, z: number, out: Float64Array): number {
  const ux = p[b] - p[a], uy = p[b + 1] - p[a + 1], uz = p[b + 2] - p[a + 2];
  const vx = p[c] - p[a], vy = p[c + 1] - p[a + 1], vz = p[c + 2] - p[a + 2];
  const px = x - p[a], py = y - p[a + 1], pz = z - p[a + 2];
  const uu = ux * ux + uy * uy + uz * uz, uv = ux * vx + uy * vy + uz * vz, vv = vx * vx + vy * vy + vz * vz;
  const up = ux * px + uy * py + uz * pz, vp = vx * px + vy * py + vz * pz;
  const determinant = uu * vv - uv * uv;
  let s = determinant > 0 ? (vv * up - uv * vp) / determinant : -1;
  let t = determinant > 0 ? (uu * vp - uv * up) / determinant : -1;
  if (s < 0 || t < 0 || s + t > 1) {
    // The nearest of the three edges: outside the triangle the nearest point is on one of them.
    const ww = uu - 2 * uv + vv;
    const onU = uu > 0 ? clamp(up / uu) : 0;
    const onV = vv > 0 ? clamp(vp / vv) : 0;
    const onW = ww > 0 ? clamp((uu - uv + vp - up) / ww) : 0;
    const atU = onU * onU * uu - 2 * onU * up;
    const atV = onV * onV * vv - 2 * onV * vp;
    const r = 1 - onW;
    const atW = r * r * uu + 2 * r * onW * uv + onW * onW * vv - 2 * (r * up + onW * vp);
    s = atU <= atV && atU <= atW ? onU : atV <= atW ? 0 : r;
    t = atU <= atV && atU <= atW ? 0 : atV <= atW ? onV : onW;
  }
  out[0] = 1 - s - t;
  out[1] = s;
  out[2] = t;
  const dx = px - s * ux - t * vx, dy = py - s * uy - t * vy, dz = pz - s * uz - t * vz;
  return Math.sqrt(dx * dx + dy * dy + dz * dz);
}

function clamp(share: number): number {
  return share < 0 ? 0 : share > 1 ? 1 : share;
}
