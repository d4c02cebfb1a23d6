// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { create, fromBinary, toBinary } from "@bufbuild/protobuf";
import type { Socket } from "../../src/calls/call_socket";
import { FrameKind, decodeFrame, encodeFrame } from "../../src/calls/frame";
import { GatewayCallBeginSchema, GatewayCallEndSchema, GatewayCallStartSchema } from "../../src/generated/tissueform/v1/gateway_pb";
import { type DeformRequest, DeformRequestSchema, DeformResponseSchema } from "../../src/generated/tissueform/v1/deform_service_pb";
import type { MessageInitShape } from "@bufbuild/protobuf";

/** A socket whose other end is the test. */
export class FakeSocket implements Socket {
  binaryType = "";
  bufferedAmount = 0;
  onopen: (() => void) | null = null;
  onmessage: ((event: { data: unknown }) => void) | null = null;
  onclose: ((event: { code: number; reason: string }) => void) | null = null;
  readonly sent: ArrayBuffer[] = [];
  closedWith: number | null = null;

  send(data: Uint8Array<ArrayBuffer>): void {
    this.sent.push(data.slice().buffer);
  }

  close(code?: number): void {
    this.closedWith = code ?? 1005;
  }

  get kinds(): FrameKind[] {
    return this.sent.map((buffer) => decodeFrame(buffer).kind);
  }

  start() {
    return fromBinary(GatewayCallStartSchema, decodeFrame(this.sent[0]).payload);
  }

  /** What a drag has sent. */
  deformRequests(): DeformRequest[] {
    const messages = this.sent.map(decodeFrame).filter((frame) => frame.kind === FrameKind.Message);
    return messages.map((frame) => fromBinary(DeformRequestSchema, frame.payload));
  }

  answer(response: MessageInitShape<typeof DeformResponseSchema>): void {
    const payload = toBinary(DeformResponseSchema, create(DeformResponseSchema, response));
    this.onmessage?.({ data: encodeFrame(FrameKind.Message, payload).buffer });
  }

  begin(headers: Record<string, string>): void {
    const payload = toBinary(GatewayCallBeginSchema, create(GatewayCallBeginSchema, { headers }));
    this.onmessage?.({ data: encodeFrame(FrameKind.Begin, payload).buffer });
  }

  heartbeat(): void {
    this.onmessage?.({ data: encodeFrame(FrameKind.Heartbeat, new Uint8Array()).buffer });
  }

  end(code: number, message = "", statusDetails: Uint8Array = new Uint8Array()): void {
    const payload = toBinary(GatewayCallEndSchema, create(GatewayCallEndSchema, { code, message, statusDetails }));
    this.onmessage?.({ data: encodeFrame(FrameKind.End, payload).buffer });
  }
}
