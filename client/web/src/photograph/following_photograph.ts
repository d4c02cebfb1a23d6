// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { FollowingSurface } from "../geometry/following_surface";
import { type BoundPhotograph, pointTriangles } from "../movingdata/photograph_data";

/** A skin as it moves: FollowingSurface of a drawn head. */
export type MovingSkin = Pick<FollowingSurface, "positions" | "normals" | "rest">;

/** A registered photograph that follows the skins it is bound to. At rest it is exactly where it was registered. */
export class FollowingPhotograph {
  readonly shape: FollowingSurface;
  private readonly moves: Float32Array;
  private readonly restNormals: Float32Array[];
  /** Of each vertex of all skins: which skin it is of, and its place there. */
  private readonly skinOf: Uint8Array;
  private readonly localOf: Uint32Array;

  /** `skins`: at rest, in the order of the registration. Throws an Error where the photograph is bound to others. */
  constructor(
    readonly bound: BoundPhotograph,
    private readonly skins: readonly MovingSkin[],
  ) {
    const count = skins.reduce((sum, { rest }) => sum + rest.length / 3, 0);
    if (bound.places.some((place) => place >= count)) throw new Error("the photograph belongs to another skin");
    this.skinOf = new Uint8Array(count);
    this.localOf = new Uint32Array(count);
    let next = 0;
    skins.forEach(({ rest }, s) => {
      for (let v = 0; v < rest.length / 3; ++v, ++next) [this.skinOf[next], this.localOf[next]] = [s, v];
    });
    this.restNormals = skins.map(({ normals }) => new Float32Array(normals));
    this.moves = new Float32Array(bound.positions.length);
    this.shape = new FollowingSurface(bound.positions, pointTriangles(bound), ownPlaces(bound.weights));
  }

  /** The skins have moved. */
  follow(): void {
    const { places, weights, offsetsMm } = this.bound;
    for (let v = 0; v < offsetsMm.length; ++v) this.followVertex(v, places, weights, offsetsMm[v]);
    this.shape.move(this.moves);
  }

  private followVertex(v: number, places: Uint32Array, weights: Float32Array, offsetMm: number): void {
    let x = 0, y = 0, z = 0, nx = 0, ny = 0, nz = 0;
    for (let k = 3 * v; k < 3 * v + 3; ++k) {
      const s = this.skinOf[places[k]];
      const at = 3 * this.localOf[places[k]];
      const { positions, rest, normals } = this.skins[s];
      const before = this.restNormals[s];
      const w = weights[k];
      x += w * (positions[at] - rest[at]);
      y += w * (positions[at + 1] - rest[at + 1]);
      z += w * (positions[at + 2] - rest[at + 2]);
      nx += w * (normals[at] - before[at]);
      ny += w * (normals[at + 1] - before[at + 1]);
      nz += w * (normals[at + 2] - before[at + 2]);
    }
    // Skin that does not move has normals that differ by rounding: the photograph over it stays exactly.
    const turn = x === 0 && y === 0 && z === 0 ? 0 : offsetMm;
    this.moves[3 * v] = x + turn * nx;
    this.moves[3 * v + 1] = y + turn * ny;
    this.moves[3 * v + 2] = z + turn * nz;
  }
}

/** Each vertex moves by its own entry; those without a weight do not. */
function ownPlaces(weights: Float32Array) {
  const places = new Uint32Array(weights.length);
  const own = new Float32Array(weights.length);
  for (let k = 0; k < weights.length; k += 3) {
    places[k] = k / 3;
    own[k] = weights[k] + weights[k + 1] + weights[k + 2] > 0 ? 1 : 0;
  }
  return { places, weights: own };
}
