// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { describe, expect, test } from "vitest";
import type { Vector } from "../../src/geometry/rotation";
import { MAX_TRIANGLES, type DroppedFile, readPhotograph } from "../../src/photograph/read_photograph";
import { reduce } from "../../src/photograph/corners";
import { container } from "../testing/small_case";
import { MTL, bundledHead, frontOf, objOf, paintedImage, paintedUv } from "../testing/painted_photograph";

const { skin, landmarks } = bundledHead();
const nose = landmarks.get("pronasale") as Vector;
const front = frontOf(skin, nose);
const uv = paintedUv(front, nose);
const image = new Uint8Array(paintedImage(landmarks));
const file = (name: string, content: string | Uint8Array<ArrayBuffer>): DroppedFile => ({ name, bytes: typeof content === "string" ? new TextEncoder().encode(content) : content });
const SQUARE = ["v 0 0 0", "v 200 0 0", "v 200 200 0", "v 0 200 0"];
const square = (...more: string[]) => file("face.obj", [...SQUARE, ...more, ""].join("\n"));

describe("OBJ with MTL and image", () => {
  test("is read with its texture, each point once", async () => {
    const { photograph, unit, notes } = await readPhotograph([file("face.obj", objOf(front, uv)), file("face.mtl", MTL), file("face.png", image)]);
    expect(photograph.positions.length).toBe(front.positions.length);
    expect(photograph.triangles.length).toBe(front.triangles.length);
    expect(photograph.image).toEqual(image);
    expect(photograph.uv?.length).toBe(2 * photograph.drawn.length);
    expect(unit).toBe("mm");
    expect(notes.join()).toContain("Unit by size: mm");
  });

  test("a seam of the texture doubles drawn vertices, not points", async () => {
    const { photograph } = await readPhotograph([square("vt 0 0", "vt 1 0", "vt 1 1", "vt 0 1", "vt 0.5 0.5", "f 1/1 2/2 3/3", "f 1/5 3/3 4/4"), file("a.png", image)]);
    expect(photograph.positions.length / 3).toBe(4);
    expect(photograph.drawn.length).toBe(5);
  });

  test("without texture coordinates only the shape is shown", async () => {
    const { photograph, notes } = await readPhotograph([square("f 1 2 3"), file("a.png", image)]);
    expect([photograph.uv, photograph.image, photograph.colors]).toEqual([null, null, null]);
    expect(notes.join()).toContain("only the shape is shown");
  });

  test.each([
    ["m", 0.001],
    ["cm", 0.1],
    ["unknown", 20],
  ])("the unit is found by size: %s", async (unit, factor) => {
    const scaled = SQUARE.map((line) => line.replace(/200/g, String(200 * factor)));
    const read = await readPhotograph([file("face.obj", [...scaled, "f 1 2 3", ""].join("\n"))]);
    expect(read.unit).toBe(unit);
    expect(Math.max(...read.photograph.positions)).toBeCloseTo(unit === "unknown" ? 4000 : 200, 3);
  });
});

test("PLY keeps the colors of its vertices", async () => {
  const ply = ["ply", "format ascii 1.0", "element vertex 3", "property float x", "property float y", "property float z", "property uchar red", "property uchar green", "property uchar blue", "element face 1", "property list uchar int vertex_indices", "end_header", "0 0 0 255 0 0", "200 0 0 10 200 30", "0 200 0 0 0 255", "3 0 1 2", ""];
  const { photograph } = await readPhotograph([file("face.ply", ply.join("\n"))]);
  expect(Array.from(photograph.colors ?? [])).toEqual([255, 0, 0, 10, 200, 30, 0, 0, 255]);
});

describe("glTF", () => {
  const positions = new Float32Array([0, 0, 0, 0.2, 0, 0, 0, 0.2, 0]);
  const coordinates = new Float32Array([0, 0.25, 1, 0, 0, 1]);
  const bin = new Uint8Array(60 + image.length);
  bin.set(new Uint8Array(positions.buffer));
  bin.set(new Uint8Array(coordinates.buffer), 36);
  bin.set(image, 60);
  const json = (buffer: object, source: object) => ({
    asset: { version: "2.0" },
    scene: 0,
    scenes: [{ nodes: [0] }],
    nodes: [{ mesh: 0 }],
    meshes: [{ primitives: [{ attributes: { POSITION: 0, TEXCOORD_0: 1 }, material: 0 }] }],
    materials: [{ pbrMetallicRoughness: { baseColorTexture: { index: 0 } } }],
    textures: [{ source: 0 }],
    images: [source],
    buffers: [{ byteLength: bin.length, ...buffer }],
    bufferViews: [{ buffer: 0, byteOffset: 0, byteLength: 36 }, { buffer: 0, byteOffset: 36, byteLength: 24 }, { buffer: 0, byteOffset: 60, byteLength: image.length }],
    accessors: [{ bufferView: 0, componentType: 5126, count: 3, type: "VEC3", min: [0, 0, 0], max: [0.2, 0.2, 0] }, { bufferView: 1, componentType: 5126, count: 3, type: "VEC2" }],
  });

  test.each([
    ["GLB with its image inside", () => [file("face.glb", container(JSON.stringify(json({}, { bufferView: 2, mimeType: "image/png" })), bin))]],
    ["glTF with its buffer and image as files", () => [file("face.gltf", JSON.stringify(json({ uri: "face.bin" }, { uri: "skin.png" }))), file("face.bin", bin), file("skin.png", image)]],
  ])("%s is read, its image from the lower edge", async (_, files) => {
    const { photograph, unit } = await readPhotograph(files());
    expect(unit).toBe("m");
    expect(photograph.image).toEqual(image);
    expect(photograph.uv?.[1]).toBeCloseTo(0.75);
    expect(Math.max(...photograph.positions)).toBeCloseTo(200, 3);
  });

  test("a buffer that is missing is named", async () => {
    await expect(readPhotograph([file("face.gltf", JSON.stringify(json({ uri: "face.bin" }, { uri: "skin.png" })))])).rejects.toThrow("its buffer (.bin) is missing");
  });
});

test.each<[string, DroppedFile[], string]>([
  ["no surface", [file("a.png", image)], "0 surfaces were given"],
  ["two surfaces", [square("f 1 2 3"), file("b.ply", "")], "2 surfaces were given"],
  ["points alone", [square()], "no triangles"],
  ["a broken PLY", [file("a.ply", "ply\nformat nonsense")], "no triangles"],
  ["a broken GLB", [file("a.glb", new Uint8Array(20))], "the GLB file cannot be read"],
  ["numbers that are none", [file("a.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")], "not a number"],
  ["another kind of image", [square("vt 0 0", "f 1/1 2/1 3/1"), file("a.png", "GIF89a")], "neither JPEG, PNG nor WebP"],
  ["too many bytes", [{ name: "a.obj", bytes: { length: 201e6 } as Uint8Array<ArrayBuffer> }], "201 MB, and the limit is 200 MB"],
])("%s: one sentence", async (_, files, text) => {
  await expect(readPhotograph(files)).rejects.toThrow(text);
});

test("what is too fine is reduced, with its seams closed", async () => {
  const { photograph } = await readPhotograph([file("face.obj", objOf(front, uv)), file("face.mtl", MTL), file("face.png", image)]);
  const reduced = reduce(photograph, 8000);
  expect(reduced.triangles.length / 3).toBeLessThanOrEqual(8000);
  expect(reduced.triangles.length / 3).toBeGreaterThan(3000);
  expect(Math.max(...reduced.drawn)).toBeLessThan(reduced.positions.length / 3);
  expect(MAX_TRIANGLES).toBe(2_000_000);
});
