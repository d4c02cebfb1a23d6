// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import * as three from "three";

/** Skin as a map is laid upon it, or as it looks. */
export const SKIN_COLOR = new three.Color(0xe2b7a3);
const BONE_COLOR = 0xe3dac6;
const TEETH_COLOR = 0xf4f0e4;
const GHOST_COLOR = 0x8fb7d9;

/** Colours of segments that users with red-green color blindness can distinguish (Okabe and Ito), lightened for shading. */
export const SEGMENT_COLORS = [0x6fb7e6, 0xf0b54a, 0x3fbf95, 0xd68fb5, 0xe88a52, 0x5a8fd0, 0xe9dc6b] as const;

export function segmentColor(index: number): number {
  return SEGMENT_COLORS[index % SEGMENT_COLORS.length];
}

/** "#6fb7e6" */
export function cssColor(color: number): string {
  return `#${color.toString(16).padStart(6, "0")}`;
}

// Light goes around an edge of skin, red further than blue: a wrapped cosine for each color stands for what scatters below
// the surface. Seen along the surface a transparent skin is denser.
function softenSkin(shader: { fragmentShader: string }): void {
  shader.fragmentShader = shader.fragmentShader
    .replace(
      "#include <lights_physical_pars_fragment>",
      // Of the diffuse light only: the gloss divides by the cosine that it is given.
      three.ShaderChunk.lights_physical_pars_fragment
        .replace(
          "vec3 irradiance = dotNL * directLight.color;",
          `vec3 irradiance = dotNL * directLight.color;
           const vec3 wrap = vec3( 0.34, 0.2, 0.16 );
           vec3 wrapped = saturate( ( dot( geometryNormal, directLight.direction ) + wrap ) / ( 1.0 + wrap ) ) * directLight.color;`,
        )
        .replace("directDiffuse += irradiance * diffuseBRDF", "directDiffuse += wrapped * diffuseBRDF"),
    )
    .replace(
      "#include <opaque_fragment>",
      `float rim = 1.0 - abs( dot( normalize( vViewPosition ), normal ) );
       if ( ! gl_FrontFacing ) outgoingLight *= vec3( 0.6, 0.4, 0.36 );
       diffuseColor.a = opacity >= 1.0 ? 1.0 : min( 1.0, opacity + ( 1.0 - opacity ) * 0.55 * rim * rim );
       #include <opaque_fragment>`,
    );
}

export function skinMaterial(): three.MeshStandardMaterial {
  const material = new three.MeshStandardMaterial({ vertexColors: true, roughness: 0.58, metalness: 0, side: three.DoubleSide });
  material.onBeforeCompile = softenSkin;
  return material;
}

/** Writes depth only: of a transparent skin its outermost layer alone is seen, not the folds behind. */
export function depthMaterial(): three.MeshBasicMaterial {
  return new three.MeshBasicMaterial({ colorWrite: false, side: three.DoubleSide, transparent: true });
}

export function boneMaterial(): three.MeshStandardMaterial {
  return new three.MeshStandardMaterial({ color: BONE_COLOR, roughness: 0.72, side: three.DoubleSide });
}

export function teethMaterial(): three.MeshStandardMaterial {
  return new three.MeshStandardMaterial({ color: TEETH_COLOR, roughness: 0.3, side: three.DoubleSide });
}

export function segmentMaterial(index: number): three.MeshStandardMaterial {
  return new three.MeshStandardMaterial({ color: segmentColor(index), roughness: 0.66, side: three.DoubleSide });
}

/** A veil whose edges are seen, also through what lies before it: the profile at rest beside the one that moved. */
export function ghostMaterial(): three.MeshBasicMaterial {
  const material = new three.MeshBasicMaterial({ color: GHOST_COLOR, transparent: true, opacity: 0.95, depthWrite: false, depthTest: false });
  material.onBeforeCompile = (shader) => {
    shader.vertexShader = shader.vertexShader
      .replace("#include <common>", "#include <common>\nvarying vec3 ghostNormal;\nvarying vec3 ghostView;")
      .replace("#include <project_vertex>", "#include <project_vertex>\nghostNormal = normalMatrix * normal;\nghostView = -mvPosition.xyz;");
    shader.fragmentShader = shader.fragmentShader
      .replace("#include <common>", "#include <common>\nvarying vec3 ghostNormal;\nvarying vec3 ghostView;")
      .replace(
        "#include <opaque_fragment>",
        `float facing = abs( dot( normalize( ghostNormal ), normalize( ghostView ) ) );
         diffuseColor.a = opacity * ( 0.05 + 0.85 * pow( 1.0 - facing, 3.0 ) );
         #include <opaque_fragment>`,
      );
  };
  return material;
}
