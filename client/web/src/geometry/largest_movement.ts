// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

/** How far a skin moves where it moves most. */
export interface LargestMovement {
  largestMm: number;
  /** Where that stays in 95 of 100 cases; null where it is not known. */
  band: { lowestMm: number; highestMm: number } | null;
}

/** Of vertices with their bands; null where none is known. Another vertex than that which moves most may give an end of the band. */
export function largestMovement(lengthsMm: Float32Array, bandsMm: Float32Array | null): LargestMovement {
  let [largestMm, lowestMm, highestMm] = [0, 0, 0];
  lengthsMm.forEach((length, i) => {
    const band = bandsMm?.[i] ?? 0;
    largestMm = Math.max(largestMm, length);
    lowestMm = Math.max(lowestMm, length - band);
    highestMm = Math.max(highestMm, length + band);
  });
  return { largestMm, band: bandsMm === null ? null : { lowestMm, highestMm } };
}

/** Of several skins together. */
export function largestOf(skins: readonly LargestMovement[]): LargestMovement {
  const most = (of: (skin: LargestMovement) => number) => skins.reduce((largest, skin) => Math.max(largest, of(skin)), 0);
  const isKnown = skins.length > 0 && skins.every(({ band }) => band !== null);
  return {
    largestMm: most(({ largestMm }) => largestMm),
    band: isKnown ? { lowestMm: most(({ band }) => band?.lowestMm ?? 0), highestMm: most(({ band }) => band?.highestMm ?? 0) } : null,
  };
}
