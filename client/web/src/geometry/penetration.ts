// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { vertexNormals } from "./following_surface";
import { type Pose, movedPoint } from "./pose";
import { type Vector, apply, fromRotationVector, scaled, subtract, transpose } from "./rotation";

// Whether a segment lies in other bone. Judged at up to 3,000 of its vertices by the nearest vertex of the other surface and the
// normal there, up to 6 mm deep: edges that pass between vertices, and thin bone that was passed through, are not seen. What lay
// in each other at rest, as at a cut, is not counted.

const REACH_MM = 6;
const MOST_SAMPLES = 3000;
const LEAST_DEPTH_MM = 0.5;

/** Where one piece of bone lies in another, at most `depthMm` deeper than at rest. */
export interface Penetration {
  segment: string;
  other: string;
  depthMm: number;
  /** In LPS, now. */
  points: Vector[];
}

/** A surface at rest whose inside can be asked for: a grid of its vertices. */
export class BoneSolid {
  private readonly cells = new Map<number, number[]>();
  private readonly normals: Float32Array;
  private readonly low: Vector;
  private readonly size: Vector;

  /** `handle`: "" for bone that does not move. */
  constructor(
    readonly name: string,
    readonly handle: string,
    private readonly positions: Float32Array,
    triangles: Uint32Array,
  ) {
    this.normals = vertexNormals(positions, triangles);
    const low: Vector = [Infinity, Infinity, Infinity];
    const high: Vector = [-Infinity, -Infinity, -Infinity];
    for (let i = 0; i < positions.length; ++i) {
      low[i % 3] = Math.min(low[i % 3], positions[i]);
      high[i % 3] = Math.max(high[i % 3], positions[i]);
    }
    this.low = low;
    this.size = [0, 1, 2].map((k) => Math.floor((high[k] - low[k]) / REACH_MM) + 1) as Vector;
    for (let v = 0; v < positions.length / 3; ++v) {
      const key = this.key(this.cell([positions[3 * v], positions[3 * v + 1], positions[3 * v + 2]]));
      const cell = this.cells.get(key);
      if (cell === undefined) this.cells.set(key, [v]);
      else cell.push(v);
    }
  }

  /** Vertices that stand for all. */
  samples(): Vector[] {
    const count = this.positions.length / 3;
    const step = Math.max(1, Math.ceil(count / MOST_SAMPLES));
    const points: Vector[] = [];
    for (let v = 0; v < count; v += step) points.push([this.positions[3 * v], this.positions[3 * v + 1], this.positions[3 * v + 2]]);
    return points;
  }

  /** How deep `point`, at rest, lies inside; 0 outside and where no vertex is within 6 mm. */
  depth(point: Vector): number {
    const cell = this.cell(point);
    let nearest = -1;
    let least = REACH_MM * REACH_MM;
    for (let x = -1; x <= 1; ++x) {
      for (let y = -1; y <= 1; ++y) {
        for (let z = -1; z <= 1; ++z) {
          for (const v of this.cells.get(this.key([cell[0] + x, cell[1] + y, cell[2] + z])) ?? []) {
            const square = this.squareDistance(point, v);
            if (square < least) [nearest, least] = [v, square];
          }
        }
      }
    }
    if (nearest < 0) return 0;
    const at = 3 * nearest;
    const height =
      (point[0] - this.positions[at]) * this.normals[at] +
      (point[1] - this.positions[at + 1]) * this.normals[at + 1] +
      (point[2] - this.positions[at + 2]) * this.normals[at + 2];
    return Math.max(0, -height);
  }

  private squareDistance(point: Vector, vertex: number): number {
    const x = point[0] - this.positions[3 * vertex];
    const y = point[1] - this.positions[3 * vertex + 1];
    const z = point[2] - this.positions[3 * vertex + 2];
    return x * x + y * y + z * z;
  }

  private cell(point: Vector): Vector {
    return [0, 1, 2].map((k) => Math.floor((point[k] - this.low[k]) / REACH_MM)) as Vector;
  }

  private key(cell: Vector): number {
    const isOut = cell.some((index, k) => index < 0 || index >= this.size[k]);
    return isOut ? -1 : cell[0] + this.size[0] * (cell[1] + this.size[1] * cell[2]);
  }
}

const AT_REST: Pose = { rotationVector: [0, 0, 0], pivotMm: [0, 0, 0], translationMm: [0, 0, 0], scale: 1 };

/** Segments of `bones` (those with a handle) in others, under these poses; reports a pair once for each segment. */
export class PenetrationTest {
  private readonly samples: { bone: BoneSolid; points: Vector[]; restDepths: Map<BoneSolid, Float32Array> }[];

  constructor(private readonly bones: BoneSolid[]) {
    this.samples = bones
      .filter((bone) => bone.handle !== "")
      .map((bone) => ({ bone, points: bone.samples(), restDepths: new Map<BoneSolid, Float32Array>() }));
    for (const sample of this.samples) {
      for (const other of this.others(sample.bone)) {
        sample.restDepths.set(other, Float32Array.from(sample.points, (point) => other.depth(point)));
      }
    }
  }

  find(poses: ReadonlyMap<string, Pose>): Penetration[] {
    const found: Penetration[] = [];
    for (const { bone, points, restDepths } of this.samples) {
      const pose = poses.get(bone.handle) ?? AT_REST;
      const moved = points.map((point) => movedPoint(pose, point));
      for (const [other, rest] of restDepths) {
        const otherPose = poses.get(other.handle) ?? AT_REST;
        const inside = deeper(moved, other, otherPose, rest);
        if (inside.points.length > 0) found.push({ segment: bone.name, other: other.name, ...inside });
      }
    }
    return found;
  }

  private others(bone: BoneSolid): BoneSolid[] {
    return this.bones.filter((other) => other.handle !== bone.handle);
  }
}

function deeper(moved: Vector[], other: BoneSolid, pose: Pose, rest: Float32Array): Pick<Penetration, "depthMm" | "points"> {
  const back = transpose(fromRotationVector(pose.rotationVector));
  const points: Vector[] = [];
  let depthMm = 0;
  moved.forEach((point, index) => {
    const turned = apply(back, subtract(subtract(point, pose.translationMm), pose.pivotMm));
    const [x, y, z] = scaled(turned, 1 / pose.scale);
    const depth = other.depth([x + pose.pivotMm[0], y + pose.pivotMm[1], z + pose.pivotMm[2]]);
    if (depth < LEAST_DEPTH_MM || depth < rest[index] + LEAST_DEPTH_MM) return;
    points.push(point);
    depthMm = Math.max(depthMm, depth - rest[index]);
  });
  return { depthMm, points };
}
