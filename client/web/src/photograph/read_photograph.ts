// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import * as three from "three";
import { GLTFLoader } from "three/examples/jsm/loaders/GLTFLoader.js";
import { MTLLoader } from "three/examples/jsm/loaders/MTLLoader.js";
import { OBJLoader } from "three/examples/jsm/loaders/OBJLoader.js";
import { PLYLoader } from "three/examples/jsm/loaders/PLYLoader.js";
import type { Photograph } from "../movingdata/photograph_data";
import { type Corners, joinCorners, reduce } from "./corners";
import { checkImage } from "./image_header";
import { type Unit, findUnit } from "./unit";

// This file is for a worker: three's loaders and what they need of three would make the planner's start larger.

/** A file as it was dropped. */
export interface DroppedFile {
  name: string;
  bytes: Uint8Array<ArrayBuffer>;
}

/** What was read; positions are in mm where the unit is known. */
export interface ReadPhotograph {
  photograph: Photograph;
  unit: Unit;
  /** Sentences for the user. */
  notes: string[];
}

export const MAX_BYTES = 200e6;
export const MAX_TRIANGLES = 2_000_000;
/** More are not drawn at frame rate by a computer without a graphics card. */
export const MAX_DRAWN_TRIANGLES = 150_000;

const text = (bytes: Uint8Array) => new TextDecoder().decode(bytes);
const ending = (name: string) => name.slice(name.lastIndexOf(".") + 1).toLowerCase();
const baseName = (path: string) => path.slice(Math.max(path.lastIndexOf("/"), path.lastIndexOf("\\")) + 1).toLowerCase();

/** Reads OBJ with MTL and image, PLY with an image or colors, glTF or GLB. Rejects with an Error in a sentence. */
export async function readPhotograph(files: readonly DroppedFile[]): Promise<ReadPhotograph> {
  const bytes = files.reduce((sum, file) => sum + file.bytes.length, 0);
  if (bytes > MAX_BYTES) throw new Error(`the photograph has ${Math.ceil(bytes / 1e6)} MB, and the limit is ${MAX_BYTES / 1e6} MB: export it smaller`);
  const models = files.filter(({ name }) => ["obj", "ply", "glb", "gltf"].includes(ending(name)));
  if (models.length !== 1) throw new Error(`${models.length} surfaces were given: choose one OBJ (with its MTL and image), PLY, glTF or GLB file`);
  const { corners, image } = await readModel(models[0], files);
  const count = corners.positions.length / 9;
  if (count === 0) throw new Error("the photograph has no triangles: choose a surface, not a cloud of points");
  if (count > MAX_TRIANGLES) throw new Error(`the photograph has ${count} triangles, and the limit is ${MAX_TRIANGLES}: export it with fewer`);
  if (!corners.positions.every(Number.isFinite)) throw new Error("the photograph has a position that is not a number: export it again");
  if (image !== null) checkImage(image);
  return finish(corners, image);
}

function finish(corners: Corners, image: Uint8Array<ArrayBuffer> | null): ReadPhotograph {
  const notes: string[] = [];
  const { unit, factor, note } = findUnit(corners.positions);
  notes.push(note);
  if (factor !== 1) corners.positions.forEach((value, i) => (corners.positions[i] = value * factor));
  const before = corners.positions.length / 9;
  const whole = joinCorners(corners, corners.uv === null ? null : image);
  const photograph = reduce(whole, MAX_DRAWN_TRIANGLES);
  const after = photograph.triangles.length / 3;
  if (after < 0.9 * before) notes.push(`${before} triangles were reduced to ${after}.`);
  if (photograph.image === null && photograph.colors === null) notes.push(image === null ? "No texture was found: only the shape is shown." : "There are no texture coordinates: only the shape is shown.");
  return { photograph, unit, notes };
}

type Model = { corners: Corners; image: Uint8Array<ArrayBuffer> | null };

async function readModel(model: DroppedFile, files: readonly DroppedFile[]): Promise<Model> {
  const kind = ending(model.name);
  try {
    if (kind === "obj") return readObj(model, files);
    if (kind === "ply") return readPly(model, files);
    return await readGltf(model, files);
  } catch (thrown) {
    throw new Error(`the ${kind.toUpperCase()} file cannot be read: ${thrown instanceof Error ? thrown.message : "it is damaged"}; export it again`);
  }
}

function readObj(model: DroppedFile, files: readonly DroppedFile[]): Model {
  const meshes: three.Mesh[] = [];
  new OBJLoader().parse(text(model.bytes)).traverse((object) => object instanceof three.Mesh && meshes.push(object));
  const names = files.filter(({ name }) => ending(name) === "mtl").flatMap(({ bytes }) => texturesOf(text(bytes)));
  const images = new Set(names);
  if (images.size > 1) throw new Error(`it has ${images.size} images, and one is shown: export it with one texture`);
  const named = files.find(({ name }) => images.has(baseName(name)));
  return { corners: cornersOf(meshes), image: named?.bytes ?? onlyImage(files) };
}

function readPly(model: DroppedFile, files: readonly DroppedFile[]): Model {
  const loader = new PLYLoader();
  // The loader's own colors are rounded to 256 linear steps, which are too few for dark skin and hair.
  loader.setCustomPropertyNameMapping({ rgb: ["red", "green", "blue"] });
  const geometry = loader.parse(model.bytes.slice().buffer);
  const corners = cornersOf([new three.Mesh(geometry)], "rgb");
  return { corners, image: onlyImage(files) };
}

/** Names of the images that materials are colored by. */
function texturesOf(mtl: string): string[] {
  const { materialsInfo } = new MTLLoader().parse(mtl, "") as unknown as { materialsInfo: Record<string, { map_kd?: string }> };
  return Object.values(materialsInfo).flatMap(({ map_kd }) => (map_kd === undefined ? [] : [baseName(map_kd.split(/\s+-\S+\s+/).pop() ?? map_kd)]));
}

function onlyImage(files: readonly DroppedFile[]): Uint8Array<ArrayBuffer> | null {
  const images = files.filter(({ name }) => ["jpg", "jpeg", "png", "webp"].includes(ending(name)));
  if (images.length > 1) throw new Error(`${images.length} images were given, and it does not say which: choose one`);
  return images[0]?.bytes ?? null;
}

async function readGltf(model: DroppedFile, files: readonly DroppedFile[]): Promise<Model> {
  const input = ending(model.name) === "glb" ? model.bytes.slice().buffer : toGlb(JSON.parse(text(model.bytes)), files);
  const loader = new GLTFLoader();
  // The page shows the image itself; the loader would fetch it, which the page's policy forbids.
  loader.register((parser) => ({ name: "without images", loadTexture: async () => new three.Texture(), parser }) as never);
  const { scene, parser } = await loader.parseAsync(input, "");
  const meshes: three.Mesh[] = [];
  scene.updateMatrixWorld(true);
  scene.traverse((object) => object instanceof three.Mesh && meshes.push(object));
  const corners = cornersOf(meshes);
  // In glTF the image begins at its upper edge.
  corners.uv?.forEach((value, i, uv) => (uv[i] = i % 2 === 1 ? 1 - value : value));
  return { corners, image: await imageOf(parser as unknown as GltfParser, files) };
}

interface GltfParser {
  json: { images?: { uri?: string; bufferView?: number }[]; materials?: { pbrMetallicRoughness?: { baseColorTexture?: { index: number } } }[]; textures?: { source?: number }[] };
  getDependency(kind: string, index: number): Promise<ArrayBuffer>;
}

async function imageOf(parser: GltfParser, files: readonly DroppedFile[]): Promise<Uint8Array<ArrayBuffer> | null> {
  const { json } = parser;
  const used = new Set((json.materials ?? []).flatMap(({ pbrMetallicRoughness }) => pbrMetallicRoughness?.baseColorTexture?.index ?? []));
  if (used.size > 1) throw new Error(`it has ${used.size} textures, and one is shown: export it with one`);
  const [texture] = used;
  const image = texture === undefined ? undefined : json.images?.[json.textures?.[texture]?.source ?? -1];
  if (image?.bufferView !== undefined) return new Uint8Array(await parser.getDependency("bufferView", image.bufferView));
  if (image?.uri?.startsWith("data:")) return fromDataUri(image.uri);
  return files.find(({ name }) => baseName(name) === baseName(decodeURIComponent(image?.uri ?? "")))?.bytes ?? null;
}

/** A glTF with its one buffer as a GLB: the loader fetches nothing then. */
function toGlb(json: { buffers?: { uri?: string }[] }, files: readonly DroppedFile[]): ArrayBuffer {
  if (json.buffers?.length !== 1) throw new Error("it does not have exactly one buffer: export a GLB");
  const [{ uri = "" }] = json.buffers;
  const bin = uri.startsWith("data:") ? fromDataUri(uri) : files.find(({ name }) => baseName(name) === baseName(decodeURIComponent(uri)))?.bytes;
  if (bin === undefined) throw new Error("its buffer (.bin) is missing: choose it, too");
  delete json.buffers[0].uri;
  const head = new TextEncoder().encode(JSON.stringify(json));
  const [jsonBytes, binBytes] = [head.length, bin.length].map((length) => 4 * Math.ceil(length / 4));
  const out = new Uint8Array(28 + jsonBytes + binBytes).fill(32, 20, 20 + jsonBytes);
  const view = new DataView(out.buffer);
  [0x46546c67, 2, out.length, jsonBytes, 0x4e4f534a].forEach((word, i) => view.setUint32(4 * i, word, true));
  out.set(head, 20);
  view.setUint32(20 + jsonBytes, binBytes, true);
  view.setUint32(24 + jsonBytes, 0x004e4942, true);
  out.set(bin, 28 + jsonBytes);
  return out.buffer;
}

function fromDataUri(uri: string): Uint8Array<ArrayBuffer> {
  return Uint8Array.from(atob(uri.slice(uri.indexOf(",") + 1)), (letter) => letter.charCodeAt(0));
}

/** All triangles of all meshes, each with corners of its own. `bytes`: the attribute with colors as sRGB bytes; "": linear ones of the name "color". */
function cornersOf(meshes: readonly three.Mesh[], bytes = ""): Corners {
  const parts = meshes.map(({ geometry, matrixWorld }) => (geometry.index === null ? geometry : geometry.toNonIndexed()).applyMatrix4(matrixWorld));
  const used = parts.filter(({ attributes }) => attributes.position !== undefined && attributes.position.count >= 3);
  const rows = (name: string, width: number) => {
    if (used.length === 0 || used.some(({ attributes }) => attributes[name] === undefined)) return null;
    return Float32Array.from(used.flatMap(({ attributes }) => [attributes[name]]).flatMap((attribute) => numbersOf(attribute, width)));
  };
  const srgb = rows(bytes, 3);
  const colors = rows("color", 3);
  const toSrgb = (value: number) => Math.round(255 * Math.min(1, Math.max(0, value <= 0.0031308 ? 12.92 * value : 1.055 * value ** (1 / 2.4) - 0.055)));
  return { positions: rows("position", 3) ?? new Float32Array(), uv: rows("uv", 2), colors: srgb !== null ? Uint8Array.from(srgb) : colors === null ? null : Uint8Array.from(colors, toSrgb) };
}

function numbersOf(attribute: three.BufferAttribute | three.InterleavedBufferAttribute, width: number): number[] {
  const count = 3 * Math.floor(attribute.count / 3);
  return Array.from({ length: width * count }, (_, i) => attribute.getComponent(Math.floor(i / width), i % width));
}
