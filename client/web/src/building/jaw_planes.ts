// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type HeadFrame, toLps } from "../geometry/pose";
import { type Vector, add, cross, dot, norm, scaled, subtract } from "../geometry/rotation";
import { type Osteotomy, type Plane, type Recipe, hasPoint } from "./recipe";

// Where cuts begin that are set by hand: the rules of core/imaging/anatomy/osteotomy.cc, on landmarks that were placed and, for
// those that were not, on an adult's mean distances from the edge of the upper incisors. A build finds landmarks in the CT; these
// are only where dragging begins.

/** Of the patient's axes where nothing says them: the scanner's. */
export const SCANNER_FRAME: HeadFrame = { originMm: [0, 0, 0], left: [1, 0, 0], posterior: [0, 1, 0], superior: [0, 0, 1], source: "scanner" };

/** Names of docs/recipe-format.md with what people read, in the order in which they are placed. */
export const LANDMARKS: readonly (readonly [string, string])[] = [
  ["upper_incisor", "Upper incisor"],
  ["lower_incisor", "Lower incisor"],
  ["upper_molar_left", "Upper molar, left"],
  ["upper_molar_right", "Upper molar, right"],
  ["lower_molar_left", "Lower molar, left"],
  ["lower_molar_right", "Lower molar, right"],
  ["pogonion", "Pogonion"],
  ["menton", "Menton"],
  ["gonion_left", "Gonion, left"],
  ["gonion_right", "Gonion, right"],
  ["condyle_left", "Condyle, left"],
  ["condyle_right", "Condyle, right"],
  ["porion_left", "Porion, left"],
  ["porion_right", "Porion, right"],
  ["orbitale_left", "Orbitale, left"],
  ["orbitale_right", "Orbitale, right"],
  ["pronasale", "Pronasale"],
  ["subnasale", "Subnasale"],
  ["labrale_superius", "Labrale superius"],
  ["labrale_inferius", "Labrale inferius"],
  ["soft_pogonion", "Soft pogonion"],
];

/** Millimeters to the left (of paired ones on the left), forward and up from the edge of the upper incisors. */
const ADULT: Record<string, Vector> = {
  upper_incisor: [0, 0, 0],
  lower_incisor: [0, -2, -1],
  upper_molar: [25, -34, 5],
  lower_molar: [24, -36, 4],
  pogonion: [0, -10, -40],
  menton: [0, -17, -47],
  gonion: [46, -77, -12],
  ramus_front: [38, -52, 14],
  last_upper_tooth: [25, -50, 12],
  nasal_floor: [0, -24, 29],
};

const SPLIT_RADIANS = (40 * Math.PI) / 180;
const BEHIND_RAMUS_MM = 4;
const OVER_LOWER_TEETH_MM = 6;
const OVER_NASAL_FLOOR_MM = 5;
const BEHIND_UPPER_TEETH_MM = 3;
const BESIDE_MOLAR_MM = 14;
const CHIN_SHARE = 0.3;

/** The recipe's planes as axes at right angles; the scanner's where it has none. */
export function headFrameOf(recipe: Recipe): HeadFrame {
  const { horizontal, midsagittal } = recipe.head_frame ?? {};
  if (!hasPoint(horizontal) && !hasPoint(midsagittal)) return SCANNER_FRAME;
  const superior = unit(hasPoint(horizontal) ? horizontal.normal : SCANNER_FRAME.superior);
  const left = unit(across(hasPoint(midsagittal) ? midsagittal.normal : SCANNER_FRAME.left, superior));
  const originMm = hasPoint(midsagittal) ? midsagittal.point_mm : SCANNER_FRAME.originMm;
  return { originMm, left, posterior: cross(superior, left), superior, source: "recipe" };
}

/** Where a landmark is, or would be from the others: those of the recipe, else by an adult's distances from `incisorMm`. */
export function anatomyOf(recipe: Recipe, incisorMm: Vector): (name: string) => Vector {
  const placed = recipe.landmarks?.points_mm ?? {};
  const frame = headFrameOf(recipe);
  const start = placed.upper_incisor ?? incisorMm;
  return (name) => {
    if (Object.hasOwn(placed, name)) return placed[name];
    const [leftMm, forwardMm, upMm] = ADULT[name.replace(/_(left|right)$/, "")] ?? [0, 0, 0];
    return add(start, toLps({ leftMm: name.endsWith("_right") ? -leftMm : leftMm, forwardMm, upMm }, frame));
  };
}

/** Through the edge of the incisors and the molars of one jaw; normal up. */
export function teethPlane(at: (name: string) => Vector, jaw: "upper" | "lower"): Plane {
  const [incisor, left, right] = [at(`${jaw}_incisor`), at(`${jaw}_molar_left`), at(`${jaw}_molar_right`)];
  const normal = unit(cross(subtract(left, incisor), subtract(right, incisor)));
  // Left and right of LPS: behind and to the left, then behind and to the right, turns up.
  return { point_mm: scaled(add(add(incisor, left), right), 1 / 3), normal };
}

/** Between the two rows of teeth; null while no landmark and no plane says where. */
export function occlusalPlaneOf(recipe: Recipe): Plane | null {
  if (hasPoint(recipe.occlusal_plane)) return recipe.occlusal_plane;
  const placed = recipe.landmarks?.points_mm ?? {};
  if (!["incisor", "molar_left", "molar_right"].some((name) => placed[`upper_${name}`] !== undefined)) return null;
  return middlePlane(anatomyOf(recipe, [0, 0, 0]));
}

export function middlePlane(at: (name: string) => Vector): Plane {
  const [upper, lower] = [teethPlane(at, "upper"), teethPlane(at, "lower")];
  return { point_mm: scaled(add(upper.point_mm, lower.point_mm), 0.5), normal: unit(add(upper.normal, lower.normal)) };
}

/** Through the means of porions and orbitalia; null unless all four are placed. */
export function frankfortOf(points: Record<string, Vector>): { horizontal: Plane; midsagittal: Plane } | null {
  const four = ["porion_left", "porion_right", "orbitale_left", "orbitale_right"].map((name) => points[name]);
  if (four.some((point) => point === undefined)) return null;
  const [poLeft, poRight, orLeft, orRight] = four;
  const middle = (a: Vector, b: Vector) => scaled(add(a, b), 0.5);
  const [porion, orbitale] = [middle(poLeft, poRight), middle(orLeft, orRight)];
  const toLeft = add(subtract(poLeft, poRight), subtract(orLeft, orRight));
  const superior = unit(cross(toLeft, subtract(porion, orbitale)));
  const left = unit(across(toLeft, superior));
  return { horizontal: { point_mm: porion, normal: superior }, midsagittal: { point_mm: porion, normal: left } };
}

/** The planes that a cut of this kind begins with. */
export function startingPlanes(kind: Osteotomy, at: (name: string) => Vector, leftAxis: Vector): Plane[] {
  if (kind === "bssro") return bssroPlanes(at, leftAxis);
  return kind === "le_fort_1" ? leFortPlanes(at, leftAxis) : chinPlanes(at);
}

function forwardOf(teeth: Plane, left: Vector): Vector {
  return unit(cross(left, teeth.normal));
}

function bssroPlanes(at: (name: string) => Vector, left: Vector): Plane[] {
  const teeth = teethPlane(at, "lower");
  const front = forwardOf(teeth, left);
  const forward = scaled(front, Math.cos(SPLIT_RADIANS));
  const inward = scaled(left, Math.sin(SPLIT_RADIANS));
  const behind = (side: string) => subtract(at(`ramus_front_${side}`), scaled(front, BEHIND_RAMUS_MM));
  return [
    { point_mm: behind("left"), normal: unit(subtract(forward, inward)) },
    { point_mm: behind("right"), normal: unit(add(forward, inward)) },
    { point_mm: add(teeth.point_mm, scaled(teeth.normal, OVER_LOWER_TEETH_MM)), normal: scaled(teeth.normal, -1) },
  ];
}

function leFortPlanes(at: (name: string) => Vector, left: Vector): Plane[] {
  const { normal: up } = teethPlane(at, "upper");
  const front = forwardOf({ point_mm: [0, 0, 0], normal: up }, left);
  const [onLeft, onRight] = [at("last_upper_tooth_left"), at("last_upper_tooth_right")];
  const last = dot(front, subtract(onLeft, onRight)) < 0 ? onLeft : onRight;
  return [
    { point_mm: add(at("nasal_floor"), scaled(up, OVER_NASAL_FLOOR_MM)), normal: scaled(up, -1) },
    { point_mm: subtract(last, scaled(front, BEHIND_UPPER_TEETH_MM)), normal: front },
    { point_mm: add(at("upper_molar_left"), scaled(left, BESIDE_MOLAR_MM)), normal: scaled(left, -1) },
    { point_mm: subtract(at("upper_molar_right"), scaled(left, BESIDE_MOLAR_MM)), normal: left },
  ];
}

function chinPlanes(at: (name: string) => Vector): Plane[] {
  const { normal: up } = teethPlane(at, "lower");
  const [menton, gonionLeft, gonionRight] = [at("menton"), at("gonion_left"), at("gonion_right")];
  const heightMm = CHIN_SHARE * dot(up, subtract(at("lower_incisor"), menton));
  const border = subtract(scaled(add(gonionLeft, gonionRight), 0.5), menton);
  const over = unit(cross(border, unit(subtract(gonionLeft, gonionRight))));
  const overBorder = dot(over, up) < 0 ? scaled(over, -1) : over;
  return [{ point_mm: add(menton, scaled(up, heightMm)), normal: scaled(unit(add(up, overBorder)), -1) }];
}

export function unit(vector: Vector): Vector {
  return scaled(vector, 1 / norm(vector));
}

/** The part of `vector` at right angles to the unit vector `axis`. */
function across(vector: Vector, axis: Vector): Vector {
  return subtract(vector, scaled(axis, dot(vector, axis)));
}
