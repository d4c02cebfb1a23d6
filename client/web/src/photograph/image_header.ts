// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

const MAX_IMAGE_PIXELS = 16384;

/** Throws an Error in a sentence where these bytes are neither JPEG, PNG nor WebP, or a PNG is too large to be drawn. */
export function checkImage(bytes: Uint8Array): void {
  if (imageType(bytes) === null) throw new Error("the image of the photograph is neither JPEG, PNG nor WebP: convert it");
  if (imageType(bytes) !== "image/png" || bytes.length < 24) return;
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const [width, height] = [view.getUint32(16), view.getUint32(20)];
  if (Math.max(width, height) > MAX_IMAGE_PIXELS) throw new Error(`the image has ${width} by ${height} pixels, and the limit is ${MAX_IMAGE_PIXELS}: export it smaller`);
}

/** By its first bytes; null: none of these. */
export function imageType(bytes: Uint8Array): string | null {
  const begins = (at: number, ...expected: number[]) => expected.every((value, i) => bytes[at + i] === value);
  if (begins(0, 0xff, 0xd8, 0xff)) return "image/jpeg";
  if (begins(0, 0x89, 0x50, 0x4e, 0x47)) return "image/png";
  return begins(0, 0x52, 0x49, 0x46, 0x46) && begins(8, 0x57, 0x45, 0x42, 0x50) ? "image/webp" : null;
}
