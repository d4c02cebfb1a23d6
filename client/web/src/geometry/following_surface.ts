// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

/** How a surface's vertices move: by the weighted sum of what three vertices do of a list that others keep. */
export interface Following {
  /** #V by 3: places in that list. */
  places: Uint32Array;
  /** #V by 3, at least 0, at most 1 together. */
  weights: Float32Array;
}

/**
 * A surface that follows the tet mesh, with its normals: positions and normals are written in place, for they are what the
 * graphics card is given. Only what can move is touched: vertices with a weight, triangles at them, normals at those.
 */
export class FollowingSurface {
  /** #V by 3, mm. */
  readonly positions: Float32Array<ArrayBuffer>;
  /** #V by 3, unit length: the mean of the triangles about a vertex by their areas. */
  readonly normals: Float32Array<ArrayBuffer>;

  private readonly moving: Uint32Array;
  private readonly places: Uint32Array;
  private readonly weights: Float32Array;
  private readonly touched: Uint32Array;
  /** Triangles at a moving vertex, and of `touched` what the other triangles give to the normals. */
  private readonly corners: Uint32Array;
  private readonly constant: Float32Array;

  /** `rest`: #V by 3; `triangles`: #T by 3; both stay the caller's and unchanged. */
  constructor(
    readonly rest: Float32Array,
    triangles: Uint32Array,
    follows: Following | null,
  ) {
    const count = rest.length / 3;
    this.positions = new Float32Array(rest);
    this.normals = vertexNormals(rest, triangles);
    this.moving = follows === null ? new Uint32Array() : movingVertices(follows, count);
    this.places = gather(follows?.places ?? new Uint32Array(), this.moving, (n) => new Uint32Array(n));
    this.weights = gather(follows?.weights ?? new Float32Array(), this.moving, (n) => new Float32Array(n));
    const isMoving = new Uint8Array(count);
    this.moving.forEach((vertex) => (isMoving[vertex] = 1));
    const moves = (t: number) => isMoving[triangles[t]] + isMoving[triangles[t + 1]] + isMoving[triangles[t + 2]] > 0;
    this.corners = selectTriangles(triangles, moves);
    this.touched = Uint32Array.from(new Set(this.corners)).sort();
    const sums = new Float32Array(rest.length);
    addTriangleNormals(rest, selectTriangles(triangles, (t) => !moves(t)), sums);
    this.constant = gather(sums, this.touched, (n) => new Float32Array(n));
  }

  get movingCount(): number {
    return this.moving.length;
  }

  /** `displacements`: three of each entry of the list, in mm. */
  move(displacements: Float32Array): void {
    this.follow(displacements, this.positions);
    this.updateNormals();
  }

  /** Where those that move would be, into `positions` (#V by 3). */
  follow(displacements: Float32Array, positions: Float32Array): void {
    const { rest, moving, places, weights } = this;
    for (let i = 0, k = 0; i < moving.length; ++i, k += 3) {
      const at = 3 * moving[i];
      const a = 3 * places[k], b = 3 * places[k + 1], c = 3 * places[k + 2];
      const u = weights[k], v = weights[k + 1], w = weights[k + 2];
      positions[at] = rest[at] + u * displacements[a] + v * displacements[b] + w * displacements[c];
      positions[at + 1] = rest[at + 1] + u * displacements[a + 1] + v * displacements[b + 1] + w * displacements[c + 1];
      positions[at + 2] = rest[at + 2] + u * displacements[a + 2] + v * displacements[b + 2] + w * displacements[c + 2];
    }
  }

  /** A number of each entry of the list, as `values` has it, laid upon the surface; 0 on what does not move. */
  spread(values: Float32Array, out: Float32Array): void {
    const { moving, places, weights } = this;
    out.fill(0);
    for (let i = 0, k = 0; i < moving.length; ++i, k += 3) {
      out[moving[i]] = weights[k] * values[places[k]] + weights[k + 1] * values[places[k + 1]] + weights[k + 2] * values[places[k + 2]];
    }
  }

  /** Of the vectors that `vectors` has, three of each entry of the list, laid upon the surface: their lengths. */
  spreadLengths(vectors: Float32Array, out: Float32Array): void {
    const { moving, places, weights } = this;
    out.fill(0);
    for (let i = 0, k = 0; i < moving.length; ++i, k += 3) {
      const a = 3 * places[k], b = 3 * places[k + 1], c = 3 * places[k + 2];
      const u = weights[k], v = weights[k + 1], w = weights[k + 2];
      const x = u * vectors[a] + v * vectors[b] + w * vectors[c];
      const y = u * vectors[a + 1] + v * vectors[b + 1] + w * vectors[c + 1];
      const z = u * vectors[a + 2] + v * vectors[b + 2] + w * vectors[c + 2];
      out[moving[i]] = Math.sqrt(x * x + y * y + z * z);
    }
  }

  private updateNormals(): void {
    const { normals, touched, constant } = this;
    for (let i = 0, k = 0; i < touched.length; ++i, k += 3) {
      const at = 3 * touched[i];
      normals[at] = constant[k];
      normals[at + 1] = constant[k + 1];
      normals[at + 2] = constant[k + 2];
    }
    addTriangleNormals(this.positions, this.corners, normals);
    normalise(normals, touched);
  }
}

/** #V by 3, unit length, by the areas of the triangles about a vertex. */
export function vertexNormals(positions: Float32Array, triangles: Uint32Array): Float32Array<ArrayBuffer> {
  const normals = new Float32Array(positions.length);
  addTriangleNormals(positions, triangles, normals);
  normalise(normals, null);
  return normals;
}

/** A vertex without area keeps 0. */
function normalise(normals: Float32Array, vertices: Uint32Array | null): void {
  const count = vertices === null ? normals.length / 3 : vertices.length;
  for (let i = 0; i < count; ++i) {
    const at = 3 * (vertices === null ? i : vertices[i]);
    const x = normals[at], y = normals[at + 1], z = normals[at + 2];
    const square = x * x + y * y + z * z;
    if (square === 0) continue;
    const inverse = 1 / Math.sqrt(square);
    normals[at] = x * inverse;
    normals[at + 1] = y * inverse;
    normals[at + 2] = z * inverse;
  }
}

function addTriangleNormals(positions: Float32Array, triangles: Uint32Array, sums: Float32Array): void {
  for (let t = 0; t < triangles.length; t += 3) {
    const a = 3 * triangles[t], b = 3 * triangles[t + 1], c = 3 * triangles[t + 2];
    const ax = positions[a], ay = positions[a + 1], az = positions[a + 2];
    const ux = positions[b] - ax, uy = positions[b + 1] - ay, uz = positions[b + 2] - az;
    const vx = positions[c] - ax, vy = positions[c + 1] - ay, vz = positions[c + 2] - az;
    const x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
    sums[a] += x;
    sums[a + 1] += y;
    sums[a + 2] += z;
    sums[b] += x;
    sums[b + 1] += y;
    sums[b + 2] += z;
    sums[c] += x;
    sums[c + 1] += y;
    sums[c + 2] += z;
  }
}

function movingVertices(follows: Following, count: number): Uint32Array {
  const moving: number[] = [];
  for (let v = 0; v < count; ++v) {
    if (follows.weights[3 * v] + follows.weights[3 * v + 1] + follows.weights[3 * v + 2] > 0) moving.push(v);
  }
  return Uint32Array.from(moving);
}

/** Rows of three of `source`, those of `rows`. */
function gather<A extends Uint32Array | Float32Array>(source: A, rows: Uint32Array, make: (length: number) => A): A {
  const out = make(3 * rows.length);
  rows.forEach((row, i) => {
    for (let k = 0; k < 3; ++k) out[3 * i + k] = source[3 * row + k];
  });
  return out;
}

/** Those whose first corner's place in `triangles` satisfies `wanted`. */
function selectTriangles(triangles: Uint32Array, wanted: (t: number) => boolean): Uint32Array {
  const corners: number[] = [];
  for (let t = 0; t < triangles.length; t += 3) {
    if (wanted(t)) corners.push(triangles[t], triangles[t + 1], triangles[t + 2]);
  }
  return Uint32Array.from(corners);
}
