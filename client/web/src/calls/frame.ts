// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

// Frames of the gateway's socket (docs/gateway.md): a head of 32 bytes, little-endian, then the payload.

export const HEAD_BYTES = 32;
const VERSION = 1;

/** What a frame is. */
export enum FrameKind {
  Start = 1,
  Message = 2,
  HalfClose = 3,
  End = 4,
  Begin = 5,
  Heartbeat = 6,
}

/** A frame as it came. All parts are views of one buffer: nothing is copied. */
export interface Frame {
  kind: FrameKind;
  payload: Uint8Array;
  /**
   * The longest `bytes` field of the message as numbers, read in place; null where the sender has not looked for one or its
   * length is no multiple of 4.
   */
  floats: Float32Array | null;
}

/** A frame of `kind` around `payload`, as a client sends it. */
export function encodeFrame(kind: FrameKind, payload: Uint8Array): Uint8Array<ArrayBuffer> {
  const bytes = new Uint8Array(HEAD_BYTES + payload.length);
  const head = new DataView(bytes.buffer);
  head.setUint8(0, VERSION);
  head.setUint8(1, kind);
  head.setUint16(2, HEAD_BYTES, true);
  head.setUint32(4, payload.length, true);
  bytes.set(payload, HEAD_BYTES);
  return bytes;
}

/** Throws an Error that says what is wrong where `buffer` is no frame; reads nothing beyond it. */
export function decodeFrame(buffer: ArrayBuffer): Frame {
  if (buffer.byteLength < HEAD_BYTES) {
    throw new Error(`a frame of ${buffer.byteLength} bytes came, which is less than its head`);
  }
  const head = new DataView(buffer);
  const version = head.getUint8(0);
  const kind = head.getUint8(1);
  const begin = head.getUint16(2, true);
  const length = head.getUint32(4, true);
  if (version !== VERSION) throw new Error(`frames of version ${version} are unknown to this page: load it again`);
  if (kind < FrameKind.Start || kind > FrameKind.Heartbeat) throw new Error(`a frame of the unknown kind ${kind} came`);
  if (begin < HEAD_BYTES || begin > HEAD_BYTES + 3 || begin + length !== buffer.byteLength) {
    throw new Error(`a frame of ${buffer.byteLength} bytes says that ${length} bytes follow at ${begin}`);
  }
  return { kind, payload: new Uint8Array(buffer, begin, length), floats: floatsOf(head, buffer, begin) };
}

function floatsOf(head: DataView, buffer: ArrayBuffer, begin: number): Float32Array | null {
  const at = head.getUint32(8, true);
  const bytes = head.getUint32(12, true);
  if (at === 0) return null;
  if (at % 4 !== 0 || at < begin || at + bytes > buffer.byteLength) {
    throw new Error(`a frame of ${buffer.byteLength} bytes says that ${bytes} bytes of numbers lie at ${at}`);
  }
  return bytes % 4 === 0 ? new Float32Array(buffer, at, bytes / 4) : null;
}

/**
 * `bytes`, a field of `frame`'s message, as float32: in place where the frame's floats are these bytes, else copied. Throws
 * where its length is not a multiple of 4.
 */
export function asFloats(frame: Frame, bytes: Uint8Array): Float32Array {
  const floats = frame.floats;
  if (floats !== null && floats.byteOffset === bytes.byteOffset && floats.byteLength === bytes.byteLength) return floats;
  if (bytes.length % 4 !== 0) throw new Error(`${bytes.length} bytes are no whole numbers`);
  return new Float32Array(bytes.slice().buffer);
}
