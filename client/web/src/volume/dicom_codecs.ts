// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import loadCharls from "@cornerstonejs/codec-charls/decodewasmjs";
import loadOpenJpeg from "@cornerstonejs/codec-openjpeg/decodewasmjs";
import { Decoder } from "jpeg-lossless-decoder-js";

/** Decodes the bytes of one image into samples, little endian. */
export type Codec = (bytes: Uint8Array<ArrayBuffer>, samples: number, bytesPerSample: number) => Uint8Array | Promise<Uint8Array>;

// Damaged streams make the libraries print, and what they print may hold anything.
const silent = { print: () => {}, printErr: () => {} };

async function fetched(url: URL): Promise<ArrayBuffer> {
  const response = await fetch(url);
  if (!response.ok) throw new Error("a part of the page is missing on the server; reload the page");
  return response.arrayBuffer();
}

let charls: Promise<DecoderModule> | null = null;
let openJpeg: Promise<DecoderModule> | null = null;

function decodeWith(decoder: CodestreamDecoder, bytes: Uint8Array): Uint8Array {
  try {
    decoder.getEncodedBuffer(bytes.length).set(bytes);
    decoder.decode();
    return decoder.getDecodedBuffer().slice();
  } finally {
    decoder.delete();
  }
}

async function jpegLs(bytes: Uint8Array): Promise<Uint8Array> {
  charls ??= fetched(new URL("../../node_modules/@cornerstonejs/codec-charls/dist/charlswasm_decode.wasm", import.meta.url)).then((wasmBinary) => loadCharls({ wasmBinary, ...silent }));
  return decodeWith(new (await charls).JpegLSDecoder(), bytes);
}

async function jpeg2000(bytes: Uint8Array): Promise<Uint8Array> {
  openJpeg ??= fetched(new URL("../../node_modules/@cornerstonejs/codec-openjpeg/dist/openjpegwasm_decode.wasm", import.meta.url)).then((wasmBinary) => loadOpenJpeg({ wasmBinary, ...silent }));
  return decodeWith(new (await openJpeg).J2KDecoder(), bytes);
}

function jpegLossless(bytes: Uint8Array<ArrayBuffer>): Uint8Array {
  const samples = new Decoder().decode(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  return new Uint8Array(samples.buffer, samples.byteOffset, samples.byteLength);
}

/** PackBits (PS3.5, annex G) of one segment into every `stride`-th byte. */
function unpackSegment(bytes: Uint8Array, out: Uint8Array, first: number, stride: number): void {
  let at = first;
  for (let i = 0; i + 1 < bytes.length && at < out.length;) {
    const control = bytes[i++];
    if (control === 128) continue;
    const count = control < 128 ? control + 1 : 257 - control;
    for (let n = 0; n < count && at < out.length; ++n, at += stride) out[at] = control < 128 ? bytes[i + n] : bytes[i];
    i += control < 128 ? count : 1;
  }
  if (at < out.length) throw new Error("the run lengths end early");
}

/** Segments hold the bytes of all samples, the most significant first. */
function runLength(bytes: Uint8Array, samples: number, bytesPerSample: number): Uint8Array {
  const header = new DataView(bytes.buffer, bytes.byteOffset, 64);
  if (header.getUint32(0, true) !== bytesPerSample) throw new Error("the number of segments is wrong");
  const out = new Uint8Array(samples * bytesPerSample);
  for (let segment = 0; segment < bytesPerSample; ++segment) {
    const start = header.getUint32(4 + 4 * segment, true);
    const end = segment + 1 < bytesPerSample ? header.getUint32(8 + 4 * segment, true) : bytes.length;
    unpackSegment(bytes.subarray(start, end), out, bytesPerSample - 1 - segment, bytesPerSample);
  }
  return out;
}

/** By transfer syntax. */
export const CODECS: ReadonlyMap<string, Codec> = new Map<string, Codec>([
  ["1.2.840.10008.1.2.5", runLength],
  ["1.2.840.10008.1.2.4.57", jpegLossless],
  ["1.2.840.10008.1.2.4.70", jpegLossless],
  ["1.2.840.10008.1.2.4.80", jpegLs],
  ["1.2.840.10008.1.2.4.81", jpegLs],
  ["1.2.840.10008.1.2.4.90", jpeg2000],
  ["1.2.840.10008.1.2.4.91", jpeg2000],
]);
