// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

/** A surface as it is shown, in mm, LPS. */
export interface ExportedSurface {
  name: string;
  /** #V by 3. */
  positions: Float32Array;
  /** #T by 3. */
  triangles: Uint32Array;
  /** #V: within which distance a vertex stays in 95 of 100 cases; null where it is not known. */
  bandMm: Float32Array | null;
}

export const NOTICE = "not a medical device";

const STL_HEADER_BYTES = 80;
const STL_TRIANGLE_BYTES = 50;

/** Binary STL of all surfaces; `remark` and the notice stand in its header, as far as they fit. */
export function toStl(surfaces: readonly ExportedSurface[], remark: string): Uint8Array<ArrayBuffer> {
  const count = surfaces.reduce((sum, surface) => sum + surface.triangles.length / 3, 0);
  const bytes = new Uint8Array(STL_HEADER_BYTES + 4 + STL_TRIANGLE_BYTES * count);
  // Not "solid" first: that is how files of text begin.
  bytes.set(new TextEncoder().encode(ascii(`Tissueform, ${NOTICE}, mm, LPS. ${remark}`)).subarray(0, STL_HEADER_BYTES));
  const view = new DataView(bytes.buffer);
  view.setUint32(STL_HEADER_BYTES, count, true);
  let at = STL_HEADER_BYTES + 4;
  for (const { positions, triangles } of surfaces) {
    for (let t = 0; t < triangles.length; t += 3, at += STL_TRIANGLE_BYTES) writeTriangle(view, at, positions, triangles, t);
  }
  return bytes;
}

function writeTriangle(view: DataView, at: number, positions: Float32Array, triangles: Uint32Array, t: number): void {
  const corner = (k: number, axis: number) => positions[3 * triangles[t + k] + axis];
  const edge = (k: number) => [0, 1, 2].map((axis) => corner(k, axis) - corner(0, axis));
  const [u, v] = [edge(1), edge(2)];
  const normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
  const length = Math.hypot(...normal) || 1;
  normal.forEach((part, axis) => view.setFloat32(at + 4 * axis, part / length, true));
  for (let k = 0; k < 3; ++k) {
    for (let axis = 0; axis < 3; ++axis) view.setFloat32(at + 12 + 12 * k + 4 * axis, corner(k, axis), true);
  }
}

const BAND_REMARK = "band_95_mm: 95 % interval of the vertex, material uncertainty only";

/** Binary PLY of all surfaces as one, with comments: the notice first, then `remarks`; with the band where it is known of all. */
export function toPly(surfaces: readonly ExportedSurface[], remarks: readonly string[]): Uint8Array<ArrayBuffer> {
  const vertexCount = surfaces.reduce((sum, surface) => sum + surface.positions.length / 3, 0);
  const triangleCount = surfaces.reduce((sum, surface) => sum + surface.triangles.length / 3, 0);
  const hasBand = surfaces.length > 0 && surfaces.every(({ bandMm }) => bandMm !== null);
  const header = [
    "ply",
    "format binary_little_endian 1.0",
    ...[NOTICE, "mm, LPS", ...(hasBand ? [BAND_REMARK] : []), ...remarks].map((remark) => `comment ${ascii(remark)}`),
    `element vertex ${vertexCount}`,
    "property float x",
    "property float y",
    "property float z",
    ...(hasBand ? ["property float band_95_mm"] : []),
    `element face ${triangleCount}`,
    "property list uchar int vertex_indices",
    "end_header\n",
  ].join("\n");
  const head = new TextEncoder().encode(header);
  const bytes = new Uint8Array(head.length + (hasBand ? 16 : 12) * vertexCount + 13 * triangleCount);
  bytes.set(head);
  const view = new DataView(bytes.buffer);
  let at = head.length;
  for (const { positions, bandMm } of surfaces) {
    for (let i = 0; i < positions.length; i += 3) {
      const row = [positions[i], positions[i + 1], positions[i + 2], ...(hasBand && bandMm !== null ? [bandMm[i / 3]] : [])];
      for (const value of row) {
        view.setFloat32(at, value, true);
        at += 4;
      }
    }
  }
  let first = 0;
  for (const { positions, triangles } of surfaces) {
    for (let t = 0; t < triangles.length; t += 3, at += 13) {
      view.setUint8(at, 3);
      for (let k = 0; k < 3; ++k) view.setInt32(at + 1 + 4 * k, first + triangles[t + k], true);
    }
    first += positions.length / 3;
  }
  return bytes;
}

/** On one line, and what is not ASCII as "?": readers of both formats expect no more. */
function ascii(text: string): string {
  return text.replace(/[^\x20-\x7e]/g, "?");
}

/** The picture with the notice and `caption` written into it. */
export async function toPng(picture: HTMLCanvasElement, background: string, caption: string): Promise<Blob> {
  const canvas = document.createElement("canvas");
  canvas.width = picture.width;
  canvas.height = picture.height;
  const context = canvas.getContext("2d");
  if (context === null) throw new Error("this browser cannot draw pictures");
  context.fillStyle = background;
  context.fillRect(0, 0, canvas.width, canvas.height);
  context.drawImage(picture, 0, 0);
  const size = Math.max(12, Math.round(canvas.height / 50));
  context.font = `${size}px system-ui, sans-serif`;
  context.fillStyle = "#7d848d";
  context.fillText(`${caption}${caption === "" ? "" : " · "}${NOTICE}`, size, canvas.height - size);
  return new Promise((resolve, reject) => {
    canvas.toBlob((blob) => (blob === null ? reject(new Error("the picture is too large to be kept")) : resolve(blob)), "image/png");
  });
}

/** Gives the browser a file to keep. */
export function download(name: string, content: Blob): void {
  const url = URL.createObjectURL(content);
  const link = document.createElement("a");
  link.href = url;
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}
