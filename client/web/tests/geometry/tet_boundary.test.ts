// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { expect, test } from "vitest";
import { tetBoundary } from "../../src/geometry/tet_boundary";

function faces(triangles: Uint32Array): string[] {
  return Array.from({ length: triangles.length / 3 }, (_, i) => Array.from(triangles.slice(3 * i, 3 * i + 3)).sort().join("")).sort();
}

test("one tet has four faces, each seen from outside", () => {
  const boundary = tetBoundary([0, 1, 2, 3], 4);
  expect(faces(boundary)).toEqual(["012", "013", "023", "123"]);
  // Of the tet with corners at the origin and the ends of the axes the volume is positive.
  const corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]];
  for (let i = 0; i < 12; i += 3) {
    const [a, b, c] = [0, 1, 2].map((k) => corners[boundary[i + k]]);
    const [u, v] = [b, c].map((other) => other.map((value, k) => value - a[k]));
    const normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    expect(normal.reduce((sum, value, k) => sum + value * (0.25 - a[k]), 0)).toBeLessThan(0);
  }
});

test("the face between two tets is none of the boundary", () => {
  expect(faces(tetBoundary([0, 1, 2, 3, 1, 4, 2, 3], 5))).toEqual(["012", "013", "023", "124", "134", "234"]);
});
