// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { readFileSync } from "node:fs";
import { fileURLToPath } from "node:url";
import { deflateSync } from "node:zlib";
import type { Vector } from "../../src/geometry/rotation";

// A synthetic photograph of the bundled head: its skin as seen from the front, with lips, brows and eyes painted where the
// landmarks are. For tests and the pictures of the documents; it shows no real person.

const HEAD = fileURLToPath(new URL("../../../../tests/data/plans/three_segments/viewer.glb", import.meta.url));
const SIZE = 512;
const BEHIND_NOSE_MM = 85;

export interface Surface {
  positions: Float32Array<ArrayBuffer>;
  triangles: Uint32Array<ArrayBuffer>;
}

/** The skin of the bundled head and landmarks by name, LPS, mm. */
export function bundledHead(path = HEAD): { skin: Surface; landmarks: Map<string, Vector> } {
  const bytes = readFileSync(path);
  const jsonLength = bytes.readUInt32LE(12);
  const json = JSON.parse(bytes.toString("utf8", 20, 20 + jsonLength));
  const bin = bytes.subarray(28 + jsonLength);
  const { attributes, indices } = json.meshes[0].primitives[0];
  const range = (index: number) => {
    const { bufferView, count, type } = json.accessors[index];
    const start = json.bufferViews[bufferView].byteOffset ?? 0;
    return new Uint8Array(bin.subarray(start, start + 4 * count * (type === "VEC3" ? 3 : 1))).buffer;
  };
  const named = json.extensions.TISSUEFORM_viewer.landmarks as { name: string; position_mm: Vector }[];
  const skin = { positions: new Float32Array(range(attributes.POSITION)), triangles: new Uint32Array(range(indices)) };
  return { skin, landmarks: new Map(named.map(({ name, position_mm }) => [name, position_mm])) };
}

/** What a camera in front of the face sees of a skin: triangles that face forward and that nothing hides by more than a fold. */
export function frontOf({ positions, triangles }: Surface, nose: Vector): Surface {
  const corners = Array.from({ length: triangles.length / 3 }, (_, t) => [0, 1, 2].map((k) => 3 * triangles[3 * t + k]));
  const cell = (at: number) => `${Math.round(positions[at] / 2)} ${Math.round(positions[at + 2] / 2)}`;
  const foremost = new Map<string, number>();
  for (let at = 0; at < positions.length; at += 3) foremost.set(cell(at), Math.min(foremost.get(cell(at)) ?? Infinity, positions[at + 1]));
  const isSeen = ([a, b, c]: number[]) => {
    const [ux, uz, vx, vz] = [positions[b] - positions[a], positions[b + 2] - positions[a + 2], positions[c] - positions[a], positions[c + 2] - positions[a + 2]];
    const forward = -(uz * vx - ux * vz);
    return forward > 0 && [a, b, c].every((at) => positions[at + 1] < nose[1] + BEHIND_NOSE_MM && positions[at + 1] < (foremost.get(cell(at)) ?? 0) + 8);
  };
  const places = new Map<number, number>();
  const kept: number[] = [];
  const place = (at: number) => places.get(at) ?? (places.set(at, kept.push(...positions.subarray(at, at + 3)) / 3 - 1), places.size - 1);
  const seen = corners.filter(isSeen).flatMap((triangle) => triangle.map(place));
  return { positions: Float32Array.from(kept), triangles: Uint32Array.from(seen) };
}

/** The same numbers in each run. */
export function randomNumbers(seed: number): () => number {
  let state = seed;
  return () => (state = (1103515245 * state + 12345) % 2147483648) / 2147483648;
}

/** Normally distributed, by Box and Muller. */
export function gaussian(random: () => number): number {
  return Math.sqrt(-2 * Math.log(1 - random())) * Math.cos(2 * Math.PI * random());
}

/** The frontal picture: u to the patient's left, v up. */
export function paintedUv({ positions }: Surface, nose: Vector): Float32Array<ArrayBuffer> {
  return Float32Array.from({ length: (2 * positions.length) / 3 }, (_, i) => {
    const at = 3 * Math.floor(i / 2);
    return i % 2 === 0 ? 0.5 + (positions[at] - nose[0]) / 200 : 0.5 + (positions[at + 2] - nose[2]) / 200;
  });
}

/** A PNG of the face from the front: 200 mm wide and high about the tip of the nose. */
export function paintedImage(landmarks: ReadonlyMap<string, Vector>): Buffer {
  const at = (name: string): [number, number] => {
    const [nose, point] = [landmarks.get("pronasale") as Vector, landmarks.get(name) as Vector];
    return [point[0] - nose[0], point[2] - nose[2]];
  };
  const random = randomNumbers(7);
  const rows = Buffer.alloc(SIZE * (3 * SIZE + 1));
  for (let y = 0; y < SIZE; ++y) {
    for (let x = 0; x < SIZE; ++x) {
      const color = colorAt((200 * (x + 0.5)) / SIZE - 100, 100 - (200 * (y + 0.5)) / SIZE, at);
      color.forEach((value, k) => (rows[y * (3 * SIZE + 1) + 1 + 3 * x + k] = Math.max(0, Math.min(255, value + 8 * random() - 4))));
    }
  }
  return png(rows);
}

function colorAt(left: number, up: number, at: (name: string) => [number, number]): number[] {
  const inside = ([x, y]: [number, number], width: number, height: number) => ((left - x) / width) ** 2 + ((up - y) / height) ** 2;
  const eyes = [at("orbitale_left"), at("orbitale_right")].map(([x, y]): [number, number] => [x, y + 12]);
  const [upper, lower] = [at("labrale_superius"), at("labrale_inferius")];
  const mouth: [number, number] = [(upper[0] + lower[0]) / 2, (upper[1] + lower[1]) / 2];
  for (const eye of eyes) {
    if (inside(eye, 3, 3) < 1) return [40, 28, 24];
    if (inside(eye, 5.5, 5.5) < 1 && inside(eye, 14, 6) < 1) return [92, 120, 88];
    if (inside(eye, 14, 6) < 1) return [238, 232, 226];
    if (inside([eye[0], eye[1] + 17], 19, 3.5) < 1) return [88, 60, 44];
  }
  if (Math.abs(up - mouth[1]) < 0.9 && Math.abs(left - mouth[0]) < 24) return [120, 52, 52];
  if (inside(mouth, 25, Math.abs(upper[1] - lower[1]) / 2 + 3) < 1) return [190, 98, 96];
  const blush = Math.exp(-Math.min(inside([-42, -8], 20, 16), inside([42, -8], 20, 16)));
  return [222 + 8 * blush, 178 - 24 * blush, 156 - 18 * blush];
}

function png(rows: Buffer): Buffer {
  const chunk = (name: string, data: Buffer) => {
    const body = Buffer.concat([Buffer.from(name), data]);
    const [length, sum] = [Buffer.alloc(4), Buffer.alloc(4)];
    length.writeUInt32BE(data.length);
    sum.writeUInt32BE(crc(body));
    return Buffer.concat([length, body, sum]);
  };
  const head = Buffer.alloc(13);
  head.writeUInt32BE(SIZE, 0);
  head.writeUInt32BE(SIZE, 4);
  head.set([8, 2, 0, 0, 0], 8);
  return Buffer.concat([Buffer.from([0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a]), chunk("IHDR", head), chunk("IDAT", deflateSync(rows)), chunk("IEND", Buffer.alloc(0))]);
}

/** The sum that PNG chunks end with; node has it from 22 on. */
function crc(bytes: Buffer): number {
  let sum = 0xffffffff;
  for (const byte of bytes) {
    sum ^= byte;
    for (let k = 0; k < 8; ++k) sum = sum & 1 ? (sum >>> 1) ^ 0xedb88320 : sum >>> 1;
  }
  return ~sum >>> 0;
}

/** An OBJ with texture coordinates that names its MTL. */
export function objOf({ positions, triangles }: Surface, uv: Float32Array): string {
  const lines = ["mtllib face.mtl", "usemtl face"];
  for (let v = 0; v < positions.length; v += 3) lines.push(`v ${positions[v].toFixed(4)} ${positions[v + 1].toFixed(4)} ${positions[v + 2].toFixed(4)}`);
  for (let v = 0; v < uv.length; v += 2) lines.push(`vt ${uv[v].toFixed(6)} ${uv[v + 1].toFixed(6)}`);
  for (let t = 0; t < triangles.length; t += 3) lines.push(`f ${Array.from(triangles.subarray(t, t + 3), (v) => `${v + 1}/${v + 1}`).join(" ")}`);
  return `${lines.join("\n")}\n`;
}

export const MTL = "newmtl face\nKd 1 1 1\nmap_Kd face.png\n";
