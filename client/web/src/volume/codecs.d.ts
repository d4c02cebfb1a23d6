// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

// The decoders' packages bring no types, or types that name files which they lack.

interface CodestreamDecoder {
  getEncodedBuffer(bytes: number): Uint8Array;
  getDecodedBuffer(): Uint8Array;
  getFrameInfo(): { width: number; height: number; bitsPerSample: number; componentCount: number };
  decode(): void;
  delete(): void;
}

interface DecoderModule {
  readonly JpegLSDecoder: new () => CodestreamDecoder;
  readonly J2KDecoder: new () => CodestreamDecoder;
}

declare module "@cornerstonejs/codec-charls/decodewasmjs" {
  export default function load(options: { wasmBinary: ArrayBuffer; print(text: string): void; printErr(text: string): void }): Promise<DecoderModule>;
}

declare module "@cornerstonejs/codec-openjpeg/decodewasmjs" {
  export default function load(options: { wasmBinary: ArrayBuffer; print(text: string): void; printErr(text: string): void }): Promise<DecoderModule>;
}

declare module "jpeg-lossless-decoder-js" {
  export class Decoder {
    decode(buffer: ArrayBufferLike, offset: number, length: number): Uint8Array | Uint16Array;
  }
}
