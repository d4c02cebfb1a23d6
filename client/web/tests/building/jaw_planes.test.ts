// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { describe, expect, test } from "vitest";
import { SCANNER_FRAME, anatomyOf, frankfortOf, headFrameOf, occlusalPlaneOf, startingPlanes, teethPlane } from "../../src/building/jaw_planes";
import { TEMPLATES, pivotOf, withTemplate } from "../../src/building/operations";
import { nearText } from "../../src/building/operation_step";
import { withHeadAngles } from "../../src/building/head_step";
import { axesGrid, areAxes } from "../../src/building/file_axes";
import { EMPTY_RECIPE, type Plane, type Recipe, hasPoint, withValue } from "../../src/building/recipe";
import { schemaProblem } from "../../src/building/recipe_schema";
import { structuresOf } from "../../src/building/structures";
import { type Vector, cross, dot, norm, subtract } from "../../src/geometry/rotation";

// Landmarks and planes that a build of the Visible Human's head found, LPS, mm, rounded: the page's rules are those of core/imaging/anatomy.
const FOUND: Record<string, Vector> = {
  lower_incisor: [250.93236, 155.31863, 1074.33733],
  lower_molar_left: [275.57222, 190.32208, 1079.0062],
  lower_molar_right: [227.6231, 187.96522, 1083],
  ramus_front_left: [290.24809, 206.99383, 1087.31523],
  ramus_front_right: [211.75381, 204.98784, 1091.51061],
};
const LEFT: Vector = [0.9982873293543426, 0.026141073709985894, -0.052335956242943835];
const BSSRO: Plane[] = [
  { point_mm: [290.18632, 210.91636, 1088.09623], normal: [-0.629857, -0.7680108, -0.1159295] },
  { point_mm: [211.69204, 208.91037, 1092.29161], normal: [0.6535165, -0.7344044, -0.1832113] },
  { point_mm: [251.71447, 176.704, 1084.65731], normal: [-0.0564264, 0.1941076, -0.9793561] },
];

const height = ({ point_mm, normal }: Plane, point: Vector) => dot(normal, subtract(point, point_mm)) / norm(normal);

test("with a build's landmarks the page begins where the build cut", () => {
  const planes = startingPlanes("bssro", (name) => FOUND[name], LEFT);
  planes.forEach((plane, index) => {
    // The teeth's plane of the build is fitted to all teeth, here to three points: the same to a few degrees and mm.
    const angle = (Math.acos(dot(plane.normal, BSSRO[index].normal)) * 180) / Math.PI;
    expect(angle).toBeLessThan(4);
    expect(Math.abs(height(BSSRO[index], plane.point_mm))).toBeLessThan(4);
  });
});

test("without landmarks all is where an adult's is, from the incisors on", () => {
  const at = anatomyOf(EMPTY_RECIPE, [10, 20, 30]);
  expect(at("upper_incisor")).toEqual([10, 20, 30]);
  expect(at("upper_molar_left")[0]).toBeGreaterThan(at("upper_molar_right")[0]);
  expect(at("menton")[2]).toBeLessThan(at("pogonion")[2]);
  expect(teethPlane(at, "upper").normal[2]).toBeGreaterThan(0.9);
  expect(occlusalPlaneOf(EMPTY_RECIPE)).toBeNull();
});

test("a landmark that was placed counts, and moves those that were not", () => {
  const recipe = withValue(EMPTY_RECIPE, ["landmarks", "points_mm", "upper_incisor"], [0, 0, 100]);
  expect(anatomyOf(recipe, [9, 9, 9])("upper_incisor")).toEqual([0, 0, 100]);
  expect(anatomyOf(recipe, [9, 9, 9])("menton")[2]).toBeLessThan(60);
});

test.each([
  ["bssro", ["lower_incisor", "menton"], ["condyle"]],
  ["le_fort_1", ["upper_incisor", "upper_molar_left", "upper_molar_right"], []],
  ["genioplasty", ["menton"], ["lower_incisor"]],
] as const)("the cut of %s keeps its jaw's landmarks on the positive side", (kind, inside, outside) => {
  const at = anatomyOf(EMPTY_RECIPE, [0, 0, 0]);
  const place = (name: string): Vector => (name === "condyle" ? [50, 80, 50] : at(name));
  const planes = startingPlanes(kind, at, SCANNER_FRAME.left);
  for (const name of inside) expect(planes.every((plane) => height(plane, place(name)) > 0), name).toBe(true);
  for (const name of outside) expect(planes.every((plane) => height(plane, place(name)) > 0), name).toBe(false);
});

describe("templates", () => {
  test.each(TEMPLATES)(" makes a recipe that is valid", ({ template }) => {
    const recipe = withTemplate(EMPTY_RECIPE, template, anatomyOf(EMPTY_RECIPE, [1, 2, 3]));
    expect(schemaProblem(recipe)).toBe("");
    expect(schemaProblem(withTemplate(recipe, template, anatomyOf(recipe, [1, 2, 3])))).toBe("");
  });

  test("names are given once", () => {
    const twice = withTemplate(withTemplate(EMPTY_RECIPE, "bssro", () => [0, 0, 0]), "bssro", () => [0, 0, 0]);
    expect(twice.segments.map(({ name }) => name)).toEqual(["mandible", "mandible_2"]);
  });

  test("a Le Fort I in three pieces has a piece for each side and one in front", () => {
    const at = anatomyOf(EMPTY_RECIPE, [0, 0, 0]);
    const { segments } = withTemplate(EMPTY_RECIPE, "le_fort_1_in_3", at);
    const pieceOf = (point: Vector) => segments.map(({ planes = [] }) => planes.every((plane) => hasPoint(plane) && height(plane, point) >= 0)).lastIndexOf(true);
    expect([[1, -1, 3], [20, 30, 5], [-20, 30, 5]].map((point) => segments[pieceOf(point as Vector)].name)).toEqual(["maxilla_front", "maxilla_left", "maxilla_right"]);
  });

  test("forward is forward of a head that is turned", () => {
    const turned = withHeadAngles(EMPTY_RECIPE, { pitchDeg: 0, rollDeg: 0, yawDeg: 90 }, [0, 0, 0]);
    expect(withTemplate(turned, "bssro", () => [0, 0, 0]).segments[0].pose?.translation_mm).toEqual([5, 0, 0]);
  });

  test("a segment turns about its teeth unless the recipe says so", () => {
    const at = anatomyOf(EMPTY_RECIPE, [0, 0, 0]);
    expect(pivotOf({ name: "a", osteotomy: "le_fort_1" }, at)).toEqual([0, 0, 0]);
    expect(pivotOf({ name: "a", pose: { pivot_mm: [1, 2, 3] } }, at)).toEqual([1, 2, 3]);
  });
});

describe("the head's position", () => {
  test("is the scanner's without planes", () => {
    expect(headFrameOf(EMPTY_RECIPE)).toBe(SCANNER_FRAME);
  });

  test("has axes at right angles, however the planes are", () => {
    const recipe: Recipe = { ...EMPTY_RECIPE, head_frame: { horizontal: { point_mm: [0, 0, 0], normal: [0, 0.4, 2] }, midsagittal: { point_mm: [1, 2, 3], normal: [1, 0.2, 0.3] } } };
    const { left, posterior, superior } = headFrameOf(recipe);
    for (const [a, b] of [[left, posterior], [left, superior], [posterior, superior]]) expect(dot(a, b)).toBeCloseTo(0, 12);
    for (const axis of [left, posterior, superior]) expect(norm(axis)).toBeCloseTo(1, 12);
    expect(dot(cross(left, posterior), superior)).toBeCloseTo(1, 12);
  });

  test("comes from porion and orbitale: up, left and back", () => {
    const planes = frankfortOf({ porion_left: [60, 100, 10], porion_right: [-60, 100, 10], orbitale_left: [30, 20, 10], orbitale_right: [-30, 20, 10] });
    expect(planes?.horizontal.normal).toEqual([0, 0, 1]);
    expect(planes?.midsagittal.normal).toEqual([1, 0, 0]);
    expect(frankfortOf({ porion_left: [1, 2, 3] })).toBeNull();
  });
});

test("axes of a file turn its grid as the builder turns it", () => {
  const grid = { size: [2, 2, 2] as const, spacing: [3.2, 3.2, 1.5] as Vector, origin: [1, 2, 3] as Vector, directions: [[1, 0, 0], [0, 1, 0], [0, 0, 1]] as [Vector, Vector, Vector] };
  const { directions, origin } = axesGrid(grid, "RPI");
  expect(directions.map((direction) => direction.map((value) => value + 0))).toEqual([[-1, 0, 0], [0, 1, 0], [0, 0, -1]]);
  expect(origin).toEqual([-1, 2, -3]);
  expect(["LPS", "RAI", "SLP"].every(areAxes)).toBe(true);
  expect(["", "LP", "LRS", "LPX", "LPSI"].some(areAxes)).toBe(false);
});

test("structures are known by the names of label maps, and by the recipe's", () => {
  const names = new Map([[1, "Mandible"], [2, "Upper Skull"], [3, "Upper Teeth"], [4, "teeth_lower"], [5, "Mandibular canal"], [6, "kiefer"], [7, "sinus"]]);
  const labels = { grid: { size: [1, 1, 1] as const, spacing: [1, 1, 1] as Vector, origin: [0, 0, 0] as Vector, directions: SCANNER_AXES }, values: new Uint8Array(1), names };
  const recipe: Recipe = { ...EMPTY_RECIPE, labels: { names: { mandible: ["kiefer", 9] } } };
  expect(Object.fromEntries(structuresOf(labels, recipe))).toEqual({ 1: "mandible", 2: "skull", 3: "upper_teeth", 4: "lower_teeth", 5: "canal", 6: "mandible", 9: "mandible" });
});
const SCANNER_AXES: [Vector, Vector, Vector] = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];

test("warnings say what a cut passes", () => {
  expect(nearText("chin", "canal", 0)).toBe("A cut of chin passes through the canal of the nerve.");
  expect(nearText("maxilla", "upper_teeth", 1.24)).toBe("A cut of maxilla passes 1.2 mm from the upper teeth.");
});
