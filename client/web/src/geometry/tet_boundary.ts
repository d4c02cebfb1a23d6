// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

/** Corners of the face opposite to each corner of a tet, counter-clockwise seen from outside where the tet's volume is positive. */
const FACES = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]] as const;

/** Triangles that belong to one tet alone, #F by 3. `tets`: #T by 4, each below `vertexCount`. */
export function tetBoundary(tets: ArrayLike<number>, vertexCount: number): Uint32Array {
  const faceCount = tets.length;
  const corner = (face: number, k: number) => tets[4 * (face >> 2) + FACES[face & 3][k]];
  const lowest = (face: number) => Math.min(corner(face, 0), corner(face, 1), corner(face, 2));
  // Faces are sorted by their lowest vertex: the two of a pair are among the few of one vertex.
  const starts = new Uint32Array(vertexCount + 1);
  for (let face = 0; face < faceCount; ++face) starts[lowest(face) + 1] += 1;
  for (let vertex = 0; vertex < vertexCount; ++vertex) starts[vertex + 1] += starts[vertex];
  const places = starts.slice();
  const sorted = new Uint32Array(faceCount);
  for (let face = 0; face < faceCount; ++face) sorted[places[lowest(face)]++] = face;
  const boundary: number[] = [];
  for (let vertex = 0; vertex < vertexCount; ++vertex) {
    const single = new Map<number, number>();
    for (let i = starts[vertex]; i < starts[vertex + 1]; ++i) {
      const corners = [corner(sorted[i], 0), corner(sorted[i], 1), corner(sorted[i], 2)];
      const key = corners.reduce((sum, other) => sum + other, 0) - vertex - Math.max(...corners) + Math.max(...corners) * vertexCount;
      if (!single.delete(key)) single.set(key, sorted[i]);
    }
    for (const face of single.values()) boundary.push(corner(face, 0), corner(face, 1), corner(face, 2));
  }
  return Uint32Array.from(boundary);
}
