// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { vertexNormals } from "./following_surface";
import { type Pose, movedPoint } from "./pose";
import { pointAt } from "./rigid_fit";
import { type Vector, add, apply, cross, dot, fromRotationVector, norm, scaled, subtract, transpose } from "./rotation";

// How far upper and lower teeth lie from each other: of each vertex of one the nearest vertex of the other, and how far along the
// normal there. Judged at vertices, which lie about half a millimetre apart in a case: a hint for the eye, no articulator.

/** Teeth further apart have no distance. */
export const MOST_GAP_MM = 6;
/** Nearer than this they touch. */
export const CONTACT_MM = 0.25;

const BESIDE_MM = 1;

export interface Teeth {
  /** #V by 3 at rest, LPS. */
  positions: Float32Array;
  triangles: Uint32Array;
  handle: string;
}

export interface Contact {
  /** Of each vertex of each of the lower teeth's surfaces the distance to the upper ones, negative inside; MOST_GAP_MM beyond. */
  lowerMm: Float32Array[];
  upperMm: Float32Array[];
  /** Of the upper teeth, where they touch or lie in the lower ones. */
  areaMm2: number;
  /** How far teeth lie in each other; 0 where they do not. */
  deepestMm: number;
  /** The nearest that both come to each other; null beyond MOST_GAP_MM. */
  leastMm: number | null;
}

const AT_REST: Pose = { rotationVector: [0, 0, 0], pivotMm: [0, 0, 0], translationMm: [0, 0, 0], scale: 1 };

/** One arch at rest, whose nearest vertex can be asked for: a grid of its vertices. */
class Arch {
  private readonly cells = new Map<string, [number, number][]>();
  private readonly normals: Float32Array[];

  constructor(readonly teeth: readonly Teeth[]) {
    this.normals = teeth.map(({ positions, triangles }) => vertexNormals(positions, triangles));
    teeth.forEach(({ positions }, part) => {
      for (let v = 0; v < positions.length / 3; ++v) {
        const key = this.cell(pointAt(positions, v)).join();
        const cell = this.cells.get(key);
        if (cell === undefined) this.cells.set(key, [[part, v]]);
        else cell.push([part, v]);
      }
    });
  }

  /** Signed, at most MOST_GAP_MM. */
  distance(point: Vector): number {
    const [x, y, z] = this.cell(point);
    let nearest: [number, number] | null = null;
    let least = MOST_GAP_MM;
    for (let i = x - 1; i <= x + 1; ++i) {
      for (let j = y - 1; j <= y + 1; ++j) {
        for (let k = z - 1; k <= z + 1; ++k) {
          for (const entry of this.cells.get(`${i},${j},${k}`) ?? []) {
            const distance = norm(subtract(point, pointAt(this.teeth[entry[0]].positions, entry[1])));
            if (distance < least) [nearest, least] = [entry, distance];
          }
        }
      }
    }
    if (nearest === null) return MOST_GAP_MM;
    const [part, vertex] = nearest;
    const height = dot(subtract(point, pointAt(this.teeth[part].positions, vertex)), pointAt(this.normals[part], vertex));
    if (height < 0) return Math.max(-least, height);
    // Beside the nearest vertex the surface is nearer than it.
    return least < BESIDE_MM ? Math.min(least, height) : least;
  }

  private cell(point: Vector): Vector {
    return point.map((part) => Math.floor(part / MOST_GAP_MM)) as Vector;
  }
}

/** The distance map between two arches under poses of their handles. */
export class ToothContact {
  private readonly upper: Arch;
  private readonly lower: Arch;

  constructor(upper: readonly Teeth[], lower: readonly Teeth[]) {
    this.upper = new Arch(upper);
    this.lower = new Arch(lower);
  }

  find(poses: ReadonlyMap<string, Pose>): Contact {
    const upperMm = distances(this.upper, this.lower, poses);
    const lowerMm = distances(this.lower, this.upper, poses);
    const all = [...upperMm, ...lowerMm].flatMap((part) => Array.from(part));
    const least = all.reduce((a, b) => Math.min(a, b), MOST_GAP_MM);
    return {
      upperMm,
      lowerMm,
      areaMm2: this.upper.teeth.reduce((sum, teeth, part) => sum + touchingArea(teeth, upperMm[part]), 0),
      deepestMm: Math.max(0, -least),
      leastMm: least >= MOST_GAP_MM ? null : Math.max(0, least),
    };
  }
}

/** Of all vertices of `from` to `to`; all of `to` moves with one handle, that of its first surface. */
function distances(from: Arch, to: Arch, poses: ReadonlyMap<string, Pose>): Float32Array[] {
  const back = inverse(poses.get(to.teeth[0]?.handle ?? "") ?? AT_REST);
  return from.teeth.map(({ positions, handle }) => {
    const pose = poses.get(handle) ?? AT_REST;
    return Float32Array.from({ length: positions.length / 3 }, (_, v) => to.distance(back(movedPoint(pose, pointAt(positions, v)))));
  });
}

function inverse(pose: Pose): (point: Vector) => Vector {
  const turn = transpose(fromRotationVector(pose.rotationVector));
  return (point) => add(pose.pivotMm, scaled(apply(turn, subtract(subtract(point, pose.translationMm), pose.pivotMm)), 1 / pose.scale));
}

/** A third of each triangle for each of its vertices that touches. */
function touchingArea({ positions, triangles }: Teeth, distancesMm: Float32Array): number {
  let area = 0;
  for (let t = 0; t < triangles.length; t += 3) {
    const touching = [0, 1, 2].filter((k) => distancesMm[triangles[t + k]] <= CONTACT_MM).length;
    if (touching === 0) continue;
    const [a, b, c] = [0, 1, 2].map((k) => pointAt(positions, triangles[t + k]));
    area += (norm(cross(subtract(b, a), subtract(c, a))) / 2) * (touching / 3);
  }
  return area;
}
