// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import * as three from "three";
import { VIRIDIS, colorTable, colorize } from "../geometry/color_map";
import { vertexNormals } from "../geometry/following_surface";
import { type BoundPhotograph, type Photograph, pointTriangles } from "../movingdata/photograph_data";
import { type Head, toLinear } from "../scene/head";
import { FollowingPhotograph } from "./following_photograph";
import { imageType } from "./image_header";

const MAX_TEXTURE_PIXELS = 4096;
/** The photograph and the CT's skin are within some mm of each other: the photograph is drawn as if it were this much nearer, so that it hides the skin. */
const NEARER_MM = 8;
const SHAPE_COLOR = 0xd9c3b6;

type PhotographMesh = three.Mesh<three.BufferGeometry, three.MeshStandardMaterial>;

/** Rows of `source`, one for each drawn vertex. */
function spread(source: Float32Array, drawn: Uint32Array, out: Float32Array): Float32Array {
  for (let d = 0; d < drawn.length; ++d) {
    const from = 3 * drawn[d];
    out[3 * d] = source[from];
    out[3 * d + 1] = source[from + 1];
    out[3 * d + 2] = source[from + 2];
  }
  return out;
}

/** Rejects with an Error in a sentence where the browser cannot decode the image. */
async function textureOf(image: Uint8Array<ArrayBuffer>): Promise<three.Texture> {
  try {
    const whole = await createImageBitmap(new Blob([image], { type: imageType(image) ?? "" }));
    const factor = Math.min(1, MAX_TEXTURE_PIXELS / Math.max(whole.width, whole.height));
    const size = { resizeWidth: Math.max(1, Math.round(factor * whole.width)), resizeHeight: Math.max(1, Math.round(factor * whole.height)) };
    const texture = new three.Texture(factor < 1 ? await createImageBitmap(whole, { ...size, resizeQuality: "high" }) : whole);
    texture.colorSpace = three.SRGBColorSpace;
    texture.flipY = false;
    texture.needsUpdate = true;
    return texture;
  } catch {
    throw new Error("the image of the photograph cannot be decoded: save it as JPEG or PNG");
  }
}

/** A mesh of a photograph, in the photograph's own axes. */
export async function photographMesh(photograph: Photograph): Promise<PhotographMesh> {
  const { positions, drawn, triangles, uv, colors, image } = photograph;
  const geometry = new three.BufferGeometry();
  const add = (name: string, values: Float32Array, width: number) => geometry.setAttribute(name, new three.BufferAttribute(values, width).setUsage(three.DynamicDrawUsage));
  add("position", spread(positions, drawn, new Float32Array(3 * drawn.length)), 3);
  add("normal", spread(vertexNormals(positions, pointTriangles(photograph)), drawn, new Float32Array(3 * drawn.length)), 3);
  const color = new Float32Array(3 * drawn.length);
  if (colors !== null) toLinear(colors, color);
  add("color", color, 3);
  // The image is decoded from its upper edge.
  if (uv !== null) add("uv", uv.map((value, i) => (i % 2 === 1 ? 1 - value : value)), 2);
  geometry.setIndex(new three.BufferAttribute(triangles, 1));
  const material = new three.MeshStandardMaterial({ roughness: 0.8, side: three.DoubleSide });
  material.map = image === null || uv === null ? null : await textureOf(image);
  material.vertexColors = colors !== null;
  material.color.set(material.map === null && colors === null ? SHAPE_COLOR : 0xffffff);
  const mesh = new three.Mesh(geometry, material);
  mesh.frustumCulled = false;
  mesh.name = "photograph";
  return mesh;
}

export function disposeMesh({ geometry, material }: PhotographMesh): void {
  geometry.dispose();
  material.map?.dispose();
  material.dispose();
}

/** A registered photograph on a head: it follows the skins of the head, and is cut where they are. */
export class DrawnPhotograph {
  /** Frames in which it moved. */
  followed = 0;
  private versions = -1;
  private isShown = true;
  private isHidden = false;
  private readonly photographColors: { map: three.Texture | null; vertexColors: boolean; color: number; values: Float32Array };

  private constructor(
    private readonly head: Head,
    readonly following: FollowingPhotograph,
    readonly mesh: PhotographMesh,
  ) {
    const { material, geometry } = mesh;
    this.photographColors = { map: material.map, vertexColors: material.vertexColors, color: material.color.getHex(), values: (geometry.attributes.color.array as Float32Array).slice() };
    mesh.renderOrder = 2;
    mesh.matrixAutoUpdate = false;
    material.onBeforeCompile = drawNearer;
    mesh.onBeforeRender = () => (material.clippingPlanes = head.skins[0]?.mesh.material.clippingPlanes ?? null);
    head.group.add(mesh);
    this.follow();
  }

  /** Rejects with an Error where the image cannot be decoded, or the photograph is of another skin. */
  static async make(head: Head, bound: BoundPhotograph): Promise<DrawnPhotograph> {
    const following = new FollowingPhotograph(bound, head.skins.map(({ shape }) => shape));
    return new DrawnPhotograph(head, following, await photographMesh(bound));
  }

  /** The skins may have moved. */
  follow(): void {
    const versions = this.head.skins.reduce((sum, { mesh }) => sum + (mesh.geometry.attributes.position as three.BufferAttribute).version, 0);
    if (versions === this.versions) return;
    this.versions = versions;
    this.following.follow();
    const { positions, normals } = this.following.shape;
    this.write("position", positions);
    this.write("normal", normals);
    this.followed += 1;
  }

  setShown(isShown: boolean): void {
    this.isShown = isShown;
    this.mesh.visible = isShown && !this.isHidden;
  }

  /** While something else is shown that it would cover. */
  setHidden(isHidden: boolean): void {
    this.isHidden = isHidden;
    this.setShown(this.isShown);
  }

  setOpacity(opacity: number): void {
    const { material } = this.mesh;
    if (material.transparent !== opacity < 1) {
      material.transparent = opacity < 1;
      material.needsUpdate = true;
    }
    material.opacity = opacity;
  }

  /** #V in mm, drawn as colors from 0 to `mostMm`; null: the photograph's own colors. */
  showDistances(distancesMm: Float32Array | null, mostMm: number): void {
    const { geometry, material } = this.mesh;
    const attribute = geometry.attributes.color as three.BufferAttribute;
    const { map, vertexColors, color, values } = this.photographColors;
    if (distancesMm === null) (attribute.array as Float32Array).set(values);
    else this.colorBy(distancesMm, mostMm, attribute.array as Float32Array);
    attribute.needsUpdate = true;
    material.map = distancesMm === null ? map : null;
    material.vertexColors = distancesMm !== null || vertexColors;
    material.color.set(distancesMm === null ? color : 0xffffff);
    material.needsUpdate = true;
  }

  remove(): void {
    this.head.group.remove(this.mesh);
    this.photographColors.map?.dispose();
    disposeMesh(this.mesh);
  }

  private colorBy(distancesMm: Float32Array, mostMm: number, out: Float32Array): void {
    const { drawn } = this.following.bound;
    const bytes = new Uint8Array(out.length);
    colorize(Float32Array.from(drawn, (point) => distancesMm[point]), mostMm, colorTable(VIRIDIS), bytes);
    toLinear(bytes, out);
  }

  private write(name: string, values: Float32Array): void {
    const attribute = this.mesh.geometry.attributes[name] as three.BufferAttribute;
    spread(values, this.following.bound.drawn, attribute.array as Float32Array);
    attribute.needsUpdate = true;
  }
}

function drawNearer(shader: { vertexShader: string }): void {
  shader.vertexShader = shader.vertexShader.replace(
    "#include <project_vertex>",
    `#include <project_vertex>
     vec4 nearerPosition = projectionMatrix * vec4( mvPosition.xyz * ( 1.0 - ${NEARER_MM.toFixed(1)} / length( mvPosition.xyz ) ), 1.0 );
     gl_Position.z = nearerPosition.z / nearerPosition.w * gl_Position.w;`,
  );
}
