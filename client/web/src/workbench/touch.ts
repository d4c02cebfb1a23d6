// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { CaseFile } from "../case/case_file";
import { VIRIDIS, colorTable } from "../geometry/color_map";
import type { Vector } from "../geometry/rotation";

const KPA_OF_N_PER_MM2 = 1000;

/** How tissue touches where it may lift off. */
export interface Touch {
  rowCount: number;
  pressingCount: number;
  mostN: number;
  /** Of the places that press, by force and area: the highest, which depends on the mesh, and of all together. Null without areas. */
  pressureKpa: { most: number; mean: number } | null;
  /** Between the two lips at most, along the normal of the seam: lips that slide on each other are not apart. */
  lipsApartMm: number;
  /** Where it presses, LPS, mm, and of each the color of its pressure, or of its force without areas. */
  points: Vector[];
  colors: Float32Array;
}

/** A contact row that may lift off: places in CaseFile.followed; `other`: of the other lip, with the direction from it. */
interface Row {
  place: number;
  other: number | null;
  normal: Vector;
}

/** The contact rows of a case, as what is followed of it shows them. */
export class TouchReader {
  private readonly rows: Row[];

  /** `rest`: of CaseFile.followed. */
  constructor(
    { followed, sessionRequest }: Pick<CaseFile, "followed" | "sessionRequest">,
    private readonly rest: Float32Array,
  ) {
    const places = new Map(Array.from(followed, (vertex, place) => [vertex, place]));
    const placeOf = (vertex: number) => places.get(vertex) ?? 0;
    const rising = sessionRequest.contact.filter(({ bilateral }) => !bilateral);
    this.rows = rising.map(({ vertex, other, normal }) => ({
      place: placeOf(vertex),
      other: other.case === "otherVertex" ? placeOf(other.value) : null,
      normal: [normal?.x ?? 0, normal?.y ?? 0, normal?.z ?? 0],
    }));
  }

  get isEmpty(): boolean {
    return this.rows.length === 0;
  }

  /** `displacements`: of CaseFile.followed. `forcesN`, `areasMm2`: of the rows that may lift off. Null where these are of other rows. */
  read(displacements: Float32Array, forcesN: Float32Array, areasMm2: Float64Array | null = null): Touch | null {
    if (forcesN.length !== this.rows.length) return null;
    const at = (place: number, axis: number) => this.rest[3 * place + axis] + displacements[3 * place + axis];
    const pressing = this.rows.map((_, row) => row).filter((row) => forcesN[row] > 0);
    // What presses on nothing has no pressure.
    const strengths = areasMm2 === null ? forcesN : forcesN.map((force, row) => (areasMm2[row] > 0 ? (KPA_OF_N_PER_MM2 * force) / areasMm2[row] : 0));
    const most = Math.max(0, ...strengths);
    const mostN = pressing.reduce((most, row) => Math.max(most, forcesN[row]), 0);
    const apart = ({ place, other, normal }: Row) => (other === null ? 0 : [0, 1, 2].reduce((sum, axis) => sum + normal[axis] * (at(place, axis) - at(other, axis)), 0));
    return {
      rowCount: this.rows.length,
      pressingCount: pressing.length,
      mostN,
      pressureKpa: areasMm2 && { most, mean: meanKpa(pressing.filter((row) => areasMm2[row] > 0), forcesN, areasMm2) },
      lipsApartMm: this.rows.reduce((most, row) => Math.max(most, apart(row)), 0),
      points: pressing.map((row) => [0, 1, 2].map((axis) => at(this.rows[row].place, axis)) as Vector),
      colors: strengthColors(pressing.map((row) => strengths[row] / (most || 1))),
    };
  }
}

function meanKpa(pressing: readonly number[], forcesN: Float32Array, areasMm2: Float64Array): number {
  const sum = (values: Float32Array | Float64Array) => pressing.reduce((all, row) => all + values[row], 0);
  return (KPA_OF_N_PER_MM2 * sum(forcesN)) / (sum(areasMm2) || Infinity);
}

/** Dark to bright: weak to strong. */
function strengthColors(shares: readonly number[]): Float32Array {
  const table = colorTable(VIRIDIS);
  return Float32Array.from(shares.flatMap((share) => [0, 1, 2].map((channel) => table[3 * Math.round(255 * share) + channel] / 255)));
}
