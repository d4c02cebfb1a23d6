// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type HeadFrame, type Pose, movedPoint } from "../geometry/pose";
import { pointAt } from "../geometry/rigid_fit";
import { anchorPoint } from "../measures/anchor";
import { FACE_LANDMARKS } from "../measures/face_landmarks";
import { type ShownFace, shownPoint } from "../measures/face_measures";
import { faceFrame, toFacePoint } from "../measures/face_point";
import { type ProfileLine, type ProfilePoint, cutProfile, nearMiddle } from "../measures/profile";
import { NOTICE } from "./files";

// The profile as surgeons draw it: the midsagittal section of the skin before (thin, blue) and after (thick), bone and teeth after
// in grey, E-lines, lips and chin named. A unit of the picture is a millimetre. Attributes only: the page allows no inline style.

/** Half of what of a surface can come into the plane; more than bone is moved by. */
const REACH_MM = 30;
const SIZE_MM = { width: 110, above: 45, below: 40 } as const;
const COLORS = { before: "#2f6fb0", after: "#b3261e", bone: "#8a8f96", text: "#1d2126", ground: "#ffffff" } as const;
const NAMES: readonly [string, string][] = [["labrale_superius", "Upper lip"], ["labrale_inferius", "Lower lip"], ["soft_pogonion", "Chin"], ["pronasale", "Nose"]];

type Points = ReadonlyMap<string, ProfilePoint>;

/** The sections of one face; made once, drawn as often as it moves. */
export class ProfileDrawing {
  private readonly parts: { surface: number; triangles: Uint32Array }[];
  private readonly before: ProfileLine[];
  private readonly frame: HeadFrame;

  constructor(private readonly face: ShownFace) {
    const { surfaces } = face.file;
    this.frame = faceFrame(face.file);
    this.parts = surfaces
      .map((source, surface) => ({ surface, kind: source.entry.kind, triangles: nearMiddle(source, this.frame, REACH_MM) }))
      .filter(({ kind, triangles }) => kind !== "bone" && triangles.length > 0);
    this.before = this.skins.flatMap(({ surface, triangles }) => cutProfile({ positions: surfaces[surface].positions, triangles }, this.frame));
  }

  /** As the face is shown now; the nose to the right by default. */
  draw(isNoseLeft = false): SVGSVGElement {
    const points = (at: (name: string) => ProfilePoint | null): Points =>
      new Map(FACE_LANDMARKS.flatMap(({ name }): [string, ProfilePoint][] => {
        const point = at(name);
        return point === null ? [] : [[name, point]];
      }));
    const { landmarks, file } = this.face;
    const before = points((name) => {
      const anchor = landmarks.placed.get(name);
      return anchor === undefined ? null : toFacePoint(anchorPoint(file.surfaces[anchor.surface], anchor), this.frame);
    });
    const after = points((name) => {
      const anchor = landmarks.placed.get(name);
      return anchor === undefined ? null : toFacePoint(shownPoint(this.face, anchor), this.frame);
    });
    const isSkin = (surface: number) => this.skins.some((skin) => skin.surface === surface);
    const bone = this.parts.filter(({ surface }) => !isSkin(surface)).flatMap((part) => this.cut(part));
    const skin = this.skins.flatMap((part) => this.cut(part));
    return picture({ before: this.before, bone, skin }, before, after, isNoseLeft);
  }

  private get skins() {
    return this.parts.filter(({ surface }) => this.face.file.surfaces[surface].entry.kind === "skin");
  }

  private cut({ surface, triangles }: { surface: number; triangles: Uint32Array }): ProfileLine[] {
    const { entry } = this.face.file.surfaces[surface];
    const positions = this.face.positionsOf(surface);
    const pose = entry.handle === "" ? undefined : this.face.shownPoses.get(entry.handle);
    const posed = pose === undefined ? positions : movedAll(positions, pose);
    return cutProfile({ positions: posed, triangles }, this.frame);
  }
}

function movedAll(positions: Float32Array, pose: Pose): Float32Array {
  const moved = new Float32Array(positions.length);
  for (let v = 0; v < positions.length / 3; ++v) moved.set(movedPoint(pose, pointAt(positions, v)), 3 * v);
  return moved;
}

function svg<K extends keyof SVGElementTagNameMap>(tag: K, attributes: Record<string, string | number>, children: (Node | string)[] = []): SVGElementTagNameMap[K] {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, typeof value === "number" ? String(Number(value.toFixed(2))) : value);
  element.append(...children);
  return element;
}

/** What is drawn, and where: x grows to the right, y down. */
interface Frame {
  x(point: ProfilePoint): number;
  y(point: ProfilePoint): number;
  width: number;
  height: number;
  outwards: 1 | -1;
}

/** Between forehead and throat, about the foremost point. */
function frameOf(before: readonly ProfileLine[], points: Points, isNoseLeft: boolean): Frame {
  const all = before.flat();
  const middle = points.get("subnasale")?.up ?? all.reduce((sum, { up }) => sum + up, 0) / Math.max(1, all.length);
  const high = Math.max(points.get("soft_glabella")?.up ?? middle, middle) + SIZE_MM.above * 0.6;
  const low = Math.min(points.get("soft_menton")?.up ?? middle - 60, middle - 30) - SIZE_MM.below * 0.6;
  const foremost = all.filter(({ up }) => up > low && up < high).reduce((most, { forward }) => Math.max(most, forward), -1000) + 28;
  const outwards = isNoseLeft ? -1 : 1;
  return {
    x: ({ forward }) => (isNoseLeft ? foremost - forward : forward - foremost + SIZE_MM.width),
    y: ({ up }) => high - up,
    width: SIZE_MM.width,
    height: high - low,
    outwards,
  };
}

function picture(lines: { before: ProfileLine[]; bone: ProfileLine[]; skin: ProfileLine[] }, before: Points, after: Points, isNoseLeft: boolean): SVGSVGElement {
  const frame = frameOf(lines.before, before, isNoseLeft);
  const { width, height } = frame;
  return svg("svg", { xmlns: "http://www.w3.org/2000/svg", viewBox: `0 0 ${width} ${height.toFixed(1)}`, width: `${width}mm`, height: `${height.toFixed(1)}mm`, "font-family": "sans-serif", role: "img", "aria-label": "Profile before and after" }, [
    svg("title", {}, [`Profile before and after, ${NOTICE}`]),
    svg("rect", { width, height, fill: COLORS.ground }),
    ...lines.bone.flatMap((line) => curve(line, frame, COLORS.bone, 0.3)),
    ...lines.before.flatMap((line) => curve(line, frame, COLORS.before, 0.4)),
    ...lines.skin.flatMap((line) => curve(line, frame, COLORS.after, 0.7)),
    ...estheticLine(before, frame, COLORS.before),
    ...estheticLine(after, frame, COLORS.after),
    ...marks(after, frame),
    ...names(after, frame),
    ...legend(frame),
  ]);
}

/** In pieces, where it leaves the picture and comes back; none where it never comes into it. */
function curve(line: ProfileLine, frame: Frame, stroke: string, width: number): SVGPathElement[] {
  const isInside = (point: ProfilePoint) => frame.x(point) >= 0 && frame.x(point) <= frame.width && frame.y(point) >= 0 && frame.y(point) <= frame.height;
  let d = "";
  let isDrawing = false;
  for (const point of line) {
    const isIn = isInside(point);
    if (isIn) d += `${isDrawing ? "L" : "M"}${frame.x(point).toFixed(2)} ${frame.y(point).toFixed(2)}`;
    isDrawing = isIn;
  }
  return d === "" ? [] : [svg("path", { d, fill: "none", stroke, "stroke-width": width, "stroke-linejoin": "round" })];
}

function estheticLine(points: Points, frame: Frame, stroke: string): SVGElement[] {
  const [nose, chin] = [points.get("pronasale"), points.get("soft_pogonion")];
  if (nose === undefined || chin === undefined) return [];
  const beyond = (from: ProfilePoint, to: ProfilePoint) => ({ forward: to.forward + 0.12 * (to.forward - from.forward), up: to.up + 0.12 * (to.up - from.up) });
  const [a, b] = [beyond(chin, nose), beyond(nose, chin)];
  return [svg("line", { x1: frame.x(a), y1: frame.y(a), x2: frame.x(b), y2: frame.y(b), stroke, "stroke-width": 0.3, "stroke-dasharray": "2 1.2" })];
}

function marks(points: Points, frame: Frame): SVGElement[] {
  return FACE_LANDMARKS.flatMap(({ name }) => {
    const point = points.get(name);
    return point === undefined || /molar|midline/.test(name) ? [] : [svg("circle", { cx: frame.x(point), cy: frame.y(point), r: 0.8, fill: COLORS.after })];
  });
}

function names(points: Points, frame: Frame): SVGElement[] {
  const anchor = frame.outwards > 0 ? "start" : "end";
  return NAMES.flatMap(([name, text]) => {
    const point = points.get(name);
    if (point === undefined) return [];
    const from = frame.x(point) + 1.5 * frame.outwards;
    const to = from + 6 * frame.outwards;
    const y = frame.y(point);
    return [
      svg("line", { x1: from, y1: y, x2: to, y2: y, stroke: COLORS.text, "stroke-width": 0.15 }),
      svg("text", { x: to + frame.outwards, y: y + 1.1, "font-size": 3.4, fill: COLORS.text, "text-anchor": anchor }, [text]),
    ];
  });
}

function legend({ height, width, outwards }: Frame): SVGElement[] {
  const x = outwards > 0 ? 4 : width - 34;
  const y = height - 13;
  const entry = (at: number, stroke: string, line: number, text: string) => [
    svg("line", { x1: x, y1: at, x2: x + 6, y2: at, stroke, "stroke-width": line }),
    svg("text", { x: x + 8, y: at + 1, "font-size": 3, fill: COLORS.text }, [text]),
  ];
  const ticks = [0, 5, 10, 15, 20].map((mm) => svg("line", { x1: x + mm, y1: height - 5, x2: x + mm, y2: height - (mm % 10 === 0 ? 7 : 6), stroke: COLORS.text, "stroke-width": 0.25 }));
  return [
    ...entry(y - 3, COLORS.before, 0.4, "before"),
    ...entry(y + 1, COLORS.after, 0.7, "after"),
    svg("line", { x1: x, y1: height - 5, x2: x + 20, y2: height - 5, stroke: COLORS.text, "stroke-width": 0.25 }),
    ...ticks,
    svg("text", { x, y: height - 1.5, "font-size": 2.6, fill: COLORS.text }, ["20 mm · dashed: E-line · " + NOTICE]),
  ];
}

/** As a file of its own, in which a unit is a millimetre. */
export function svgText(drawing: SVGSVGElement): string {
  return `<?xml version="1.0" encoding="UTF-8"?>\n${new XMLSerializer().serializeToString(drawing)}\n`;
}

const PIXELS_PER_MM = 10;

/** As a PNG of ten pixels a millimetre. */
export async function toPicture(drawing: SVGSVGElement): Promise<Blob> {
  const url = URL.createObjectURL(new Blob([svgText(drawing)], { type: "image/svg+xml" }));
  try {
    const image = new Image();
    image.src = url;
    await image.decode();
    const { width, height } = drawing.viewBox.baseVal;
    const canvas = document.createElement("canvas");
    canvas.width = Math.round(PIXELS_PER_MM * width);
    canvas.height = Math.round(PIXELS_PER_MM * height);
    canvas.getContext("2d")?.drawImage(image, 0, 0, canvas.width, canvas.height);
    return await new Promise((resolve, reject) => {
      canvas.toBlob((blob) => (blob === null ? reject(new Error("the picture is too large to be kept")) : resolve(blob)), "image/png");
    });
  } finally {
    URL.revokeObjectURL(url);
  }
}
