// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { expect, test } from "vitest";
import { openCase } from "../../src/case/case_file";
import { Head } from "../../src/scene/head";
import { FaceColors } from "../../src/workbench/face_colors";
import { smallCase, sourceOf } from "../testing/small_case";

test("a map of lengths knows the largest with its band, one without a band none", async () => {
  const file = await openCase(sourceOf(smallCase()));
  const colors = new FaceColors(new Head(file));
  // Vertex 0 of the skin goes with the first of the list, vertex 2 with the last.
  const count = file.followed.length;
  const moved = Float32Array.from({ length: 3 * count }, (_, i) => (i === 1 ? -4 : 0));
  const band = Float32Array.from({ length: count }, (_, i) => (i === 0 ? 0.5 : 0.125));
  expect(colors.showLengths("Movement", moved, band)).toEqual({ title: "Movement", mostMm: 4, largestMm: 4, band: { lowestMm: 3.5, highestMm: 4.5 } });
  expect(colors.showLengths("Difference", moved).band).toBeNull();
  expect(colors.showNumbers("Band", band)).toMatchObject({ largestMm: 0.5, band: null });
});
