// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { describe, expect, test } from "vitest";
import { FrameKind, HEAD_BYTES, asFloats, decodeFrame, encodeFrame } from "../../src/calls/frame";

function changed(change: (view: DataView) => void, payload = new Uint8Array([1, 2, 3, 4])): ArrayBuffer {
  const frame = encodeFrame(FrameKind.Message, payload);
  change(new DataView(frame.buffer));
  return frame.buffer;
}

describe("frames of the gateway's socket", () => {
  test("a frame comes back as it was made", () => {
    const payload = new Uint8Array([5, 6, 7]);
    const frame = decodeFrame(encodeFrame(FrameKind.HalfClose, payload).buffer);
    expect(frame.kind).toBe(FrameKind.HalfClose);
    expect(frame.payload).toEqual(payload);
    expect(frame.floats).toBeNull();
  });

  test("numbers are read in place", () => {
    const buffer = changed((view) => {
      view.setUint32(8, HEAD_BYTES, true);
      view.setUint32(12, 4, true);
      view.setFloat32(HEAD_BYTES, 1.5, true);
    });
    const frame = decodeFrame(buffer);
    expect(frame.floats?.buffer).toBe(buffer);
    expect(asFloats(frame, frame.payload)).toBe(frame.floats);
    expect(frame.floats?.[0]).toBe(1.5);
  });

  test("numbers that do not lie in place are copied", () => {
    const frame = decodeFrame(changed((view) => view.setFloat32(HEAD_BYTES, 2.5, true)));
    expect(asFloats(frame, frame.payload)[0]).toBe(2.5);
  });

  test("bytes that are no whole numbers are refused", () => {
    const frame = decodeFrame(encodeFrame(FrameKind.Message, new Uint8Array(3)).buffer);
    expect(() => asFloats(frame, frame.payload)).toThrow("no whole numbers");
  });

  test.each<[string, (view: DataView) => void]>([
    ["another version", (view) => view.setUint8(0, 2)],
    ["no kind", (view) => view.setUint8(1, 0)],
    ["an unknown kind", (view) => view.setUint8(1, 7)],
    ["a payload that becomes valid in the head", (view) => view.setUint16(2, 31, true)],
    ["a payload that begins too far", (view) => view.setUint16(2, 36, true)],
    ["a payload that is longer than the frame", (view) => view.setUint32(4, 5, true)],
    ["a payload that ends before the frame", (view) => view.setUint32(4, 3, true)],
    ["numbers at no multiple of four", (view) => view.setUint32(8, 33, true)],
    ["numbers in the head", (view) => view.setUint32(8, 28, true)],
    ["numbers past the end", (view) => {
      view.setUint32(8, HEAD_BYTES, true);
      view.setUint32(12, 8, true);
    }],
    ["numbers of 4 GB", (view) => {
      view.setUint32(8, HEAD_BYTES, true);
      view.setUint32(12, 0xffffffff, true);
    }],
  ])("a frame with %s is refused", (_, change) => {
    expect(() => decodeFrame(changed(change))).toThrow();
  });

  test("what is shorter than a head is refused", () => {
    for (let length = 0; length < HEAD_BYTES; ++length) expect(() => decodeFrame(new ArrayBuffer(length))).toThrow("less than its head");
  });
});
