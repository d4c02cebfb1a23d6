// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Vector } from "../geometry/rotation";

/** Triangles of a block; a plane skips a block whose box it does not cross. */
const BLOCK = 32;
const GRID_BITS = 10;

/**
 * The triangles of a mesh in blocks of neighbors, each in a box: a plane looks only at the blocks that it crosses. A mesh that
 * moves keeps its blocks; only their boxes are fitted again.
 */
export class MeshCut {
  private readonly corners: Uint32Array;
  /** For each block: middle and half size along x, y, z. */
  private readonly boxes: Float32Array;
  private positions: Float32Array;
  /** How often vertices were placed: lines of an earlier count are no longer true. */
  private placedCount = 0;

  /** `positions`: #V by 3, LPS, mm; `triangles`: #T by 3. */
  constructor(positions: Float32Array, triangles: Uint32Array) {
    this.corners = orderedTriangles(positions, triangles);
    this.boxes = new Float32Array(6 * Math.ceil(triangles.length / 3 / BLOCK));
    this.positions = positions;
    this.fit(positions);
  }

  get version(): number {
    return this.placedCount;
  }

  /** The vertices are now here; `positions` is not copied. */
  fit(positions: Float32Array): void {
    this.positions = positions;
    this.placedCount += 1;
    for (let block = 0; 6 * block < this.boxes.length; ++block) this.fitBlock(block);
  }

  /** Lines in the plane, each #P by 3, LPS, mm; a closed one repeats its first point. `normal` has unit length. */
  cut(point: Vector, normal: Vector): Float32Array[] {
    const { boxes, corners } = this;
    const [nx, ny, nz] = normal;
    const offset = nx * point[0] + ny * point[1] + nz * point[2];
    const lines = new LineChains(this.positions, normal, offset);
    for (let block = 0, b = 0; b < boxes.length; ++block, b += 6) {
      const reach = Math.abs(nx) * boxes[b + 3] + Math.abs(ny) * boxes[b + 4] + Math.abs(nz) * boxes[b + 5];
      if (Math.abs(nx * boxes[b] + ny * boxes[b + 1] + nz * boxes[b + 2] - offset) > reach) continue;
      const end = Math.min(corners.length, 3 * BLOCK * (block + 1));
      for (let t = 3 * BLOCK * block; t < end; t += 3) lines.addTriangle(corners[t], corners[t + 1], corners[t + 2]);
    }
    return lines.chains();
  }

  private fitBlock(block: number): void {
    const { positions, corners, boxes } = this;
    const end = Math.min(corners.length, 3 * BLOCK * (block + 1));
    let lowX = Infinity, lowY = Infinity, lowZ = Infinity, highX = -Infinity, highY = -Infinity, highZ = -Infinity;
    for (let t = 3 * BLOCK * block; t < end; ++t) {
      const at = 3 * corners[t];
      const x = positions[at], y = positions[at + 1], z = positions[at + 2];
      if (x < lowX) lowX = x;
      if (x > highX) highX = x;
      if (y < lowY) lowY = y;
      if (y > highY) highY = y;
      if (z < lowZ) lowZ = z;
      if (z > highZ) highZ = z;
    }
    // Rounding to float32 must not make the box smaller than its triangles.
    boxes.set([(lowX + highX) / 2, (lowY + highY) / 2, (lowZ + highZ) / 2, (highX - lowX) / 2 + 1e-3, (highY - lowY) / 2 + 1e-3, (highZ - lowZ) / 2 + 1e-3], 6 * block);
  }
}

/** Triangles ordered along a Morton curve, so that those in a row are near each other. */
function orderedTriangles(positions: Float32Array, triangles: Uint32Array): Uint32Array {
  const count = triangles.length / 3;
  const codes = new Float64Array(count);
  const { low, scale } = gridOf(positions);
  for (let t = 0; t < count; ++t) {
    const a = 3 * triangles[3 * t];
    let code = 0;
    for (let axis = 0; axis < 3; ++axis) code += spread((positions[a + axis] - low[axis]) * scale) * 2 ** axis;
    // The number of the triangle is in the digits below the code, so that one sort of numbers orders both.
    codes[t] = code * 2 ** 22 + t;
  }
  codes.sort();
  const ordered = new Uint32Array(triangles.length);
  codes.forEach((code, place) => {
    const t = code % 2 ** 22;
    for (let k = 0; k < 3; ++k) ordered[3 * place + k] = triangles[3 * t + k];
  });
  return ordered;
}

function gridOf(positions: Float32Array): { low: number[]; scale: number } {
  const [low, high] = [[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]];
  for (let i = 0; i < positions.length; ++i) {
    low[i % 3] = Math.min(low[i % 3], positions[i]);
    high[i % 3] = Math.max(high[i % 3], positions[i]);
  }
  const span = Math.max(1e-6, ...high.map((value, axis) => value - low[axis]));
  return { low, scale: (2 ** GRID_BITS - 1) / span };
}

/** Puts two zero bits after each bit. */
function spread(value: number): number {
  let bits = Math.floor(value) & 0x3ff;
  bits = (bits | (bits << 16)) & 0x030000ff;
  bits = (bits | (bits << 8)) & 0x0300f00f;
  bits = (bits | (bits << 4)) & 0x030c30c3;
  return (bits | (bits << 2)) & 0x09249249;
}

/** The lines of meshes in one slice, which are cut again only where the slice or a mesh has moved. */
export class SliceLines {
  private known = new Map<MeshCut, { version: number; lines: readonly Float32Array[] }>();
  private slice = "";

  /** Through `point`; `normal` has unit length. */
  of(meshes: readonly MeshCut[], point: Vector, normal: Vector): readonly (readonly Float32Array[])[] {
    const slice = [...normal, normal[0] * point[0] + normal[1] * point[1] + normal[2] * point[2]].map((number) => number.toFixed(6)).join();
    const before = slice === this.slice ? this.known : new Map<MeshCut, { version: number; lines: readonly Float32Array[] }>();
    const cuts = meshes.map((mesh) => {
      const cut = before.get(mesh);
      return cut?.version === mesh.version ? cut : { version: mesh.version, lines: mesh.cut(point, normal) };
    });
    this.slice = slice;
    this.known = new Map(meshes.map((mesh, index) => [mesh, cuts[index]]));
    return cuts.map(({ lines }) => lines);
  }
}

/** Where triangles cross a plane, joined to lines over the edges that two triangles share. */
class LineChains {
  private readonly pointOfEdge = new Map<number, number>();
  private readonly points: number[] = [];
  /** Two neighbors of each point, or -1. */
  private readonly neighbors: number[] = [];
  /** Segments at an edge of three or more triangles. */
  private readonly extra: Float32Array[] = [];

  constructor(
    private readonly positions: Float32Array,
    private readonly normal: Vector,
    private readonly offset: number,
  ) {}

  addTriangle(a: number, b: number, c: number): void {
    const [da, db, dc] = [this.distance(a), this.distance(b), this.distance(c)];
    const [isA, isB, isC] = [da >= 0, db >= 0, dc >= 0];
    if (isA === isB && isB === isC) return;
    if (isA === isB) this.join(this.crossing(c, dc, a, da), this.crossing(c, dc, b, db));
    else if (isA === isC) this.join(this.crossing(b, db, a, da), this.crossing(b, db, c, dc));
    else this.join(this.crossing(a, da, b, db), this.crossing(a, da, c, dc));
  }

  chains(): Float32Array[] {
    const isUsed = new Uint8Array(this.points.length / 3);
    const lines: Float32Array[] = [];
    const walk = (start: number) => {
      if (isUsed[start] === 0) lines.push(this.walk(start, isUsed));
    };
    // Open lines are walked from an end; what then remains is closed.
    for (let p = 0; p < isUsed.length; ++p) if (this.neighbors[2 * p + 1] < 0) walk(p);
    for (let p = 0; p < isUsed.length; ++p) walk(p);
    return [...lines, ...this.extra];
  }

  private distance(vertex: number): number {
    const { positions, normal } = this;
    return normal[0] * positions[3 * vertex] + normal[1] * positions[3 * vertex + 1] + normal[2] * positions[3 * vertex + 2] - this.offset;
  }

  /** Both triangles of an edge get the same point. */
  private crossing(a: number, da: number, b: number, db: number): number {
    const key = Math.min(a, b) * 2 ** 26 + Math.max(a, b);
    const known = this.pointOfEdge.get(key);
    if (known !== undefined) return known;
    const place = this.points.length / 3;
    const share = da / (da - db);
    for (let k = 0; k < 3; ++k) this.points.push(this.positions[3 * a + k] + share * (this.positions[3 * b + k] - this.positions[3 * a + k]));
    this.neighbors.push(-1, -1);
    this.pointOfEdge.set(key, place);
    return place;
  }

  private join(p: number, q: number): void {
    const { neighbors } = this;
    const isFull = neighbors[2 * p + 1] >= 0 || neighbors[2 * q + 1] >= 0;
    if (isFull) {
      this.extra.push(Float32Array.from([...this.points.slice(3 * p, 3 * p + 3), ...this.points.slice(3 * q, 3 * q + 3)]));
      return;
    }
    neighbors[neighbors[2 * p] < 0 ? 2 * p : 2 * p + 1] = q;
    neighbors[neighbors[2 * q] < 0 ? 2 * q : 2 * q + 1] = p;
  }

  private walk(start: number, isUsed: Uint8Array): Float32Array {
    const line: number[] = [];
    let [previous, at] = [-1, start];
    while (at >= 0 && isUsed[at] === 0) {
      isUsed[at] = 1;
      for (let k = 0; k < 3; ++k) line.push(this.points[3 * at + k]);
      const [a, b]: number[] = [this.neighbors[2 * at], this.neighbors[2 * at + 1]];
      const next: number = a !== previous ? a : b;
      [previous, at] = [at, next];
    }
    if (at === start) line.push(...this.points.slice(3 * start, 3 * start + 3));
    return Float32Array.from(line);
  }
}
