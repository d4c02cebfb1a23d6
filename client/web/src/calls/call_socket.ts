// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { create, fromBinary, toBinary, type DescMethod, type MessageShape } from "@bufbuild/protobuf";
import { GatewayCallBeginSchema, GatewayCallEndSchema, GatewayCallStartSchema } from "../generated/tissueform/v1/gateway_pb";
import { CallError, Code, callErrorOf } from "./call_error";
import { type Frame, FrameKind, decodeFrame, encodeFrame } from "./frame";

/** The part of a WebSocket that a call needs; tests have their own. */
export interface Socket {
  binaryType: string;
  readonly bufferedAmount: number;
  onopen: (() => void) | null;
  onmessage: ((event: { data: unknown }) => void) | null;
  onclose: ((event: { code: number; reason: string }) => void) | null;
  send(data: Uint8Array<ArrayBuffer>): void;
  close(code?: number): void;
}

/** Makes the socket of one call. */
export type SocketFactory = () => Socket;

/** What a call tells its owner. Nothing is told after `onEnd`, and nothing after `cancel`. */
export interface CallHandlers<Response> {
  /** What the server says of itself before its first message, by names in lower case; not told where it says nothing. */
  onBegin?(headers: Record<string, string>): void;
  /** A message of the server, with the frame that it lies in. */
  onMessage(message: Response, frame: Frame): void;
  /** Once: null when the call ended well. */
  onEnd(error: CallError | null): void;
}

export interface CallOptions {
  /** Names in lower case, as docs/gateway.md lists them. */
  metadata?: Record<string, string>;
  /** From now; left out: none. */
  deadlineMs?: number;
}

/**
 * One call of any kind over one WebSocket of the gateway. What is sent before the socket is open waits for that. A frame that is
 * none, or a handler that throws, ends the call with an error; so does a socket that closes without an end.
 */
export class CallSocket<M extends DescMethod> {
  private readonly socket: Socket;
  private waiting: Uint8Array<ArrayBuffer>[] | null = [];
  private over = false;

  constructor(
    factory: SocketFactory,
    private readonly method: M,
    private readonly handlers: CallHandlers<MessageShape<M["output"]>>,
    options: CallOptions = {},
  ) {
    this.socket = factory();
    this.socket.binaryType = "arraybuffer";
    this.socket.onopen = () => this.open();
    this.socket.onmessage = (event) => this.receive(event.data);
    this.socket.onclose = (event) => this.end(closedError(event.code));
    const start = create(GatewayCallStartSchema, {
      method: `/${method.parent.typeName}/${method.name}`,
      metadata: options.metadata ?? {},
      deadlineMs: BigInt(Math.ceil(options.deadlineMs ?? 0)),
      tellsBegin: handlers.onBegin !== undefined,
    });
    this.write(FrameKind.Start, toBinary(GatewayCallStartSchema, start));
  }

  /** Bytes that were sent and have not left the page. */
  get bufferedBytes(): number {
    return this.socket.bufferedAmount;
  }

  /** Nothing happens after the call's end. */
  send(message: MessageShape<M["input"]>): void {
    this.write(FrameKind.Message, toBinary(this.method.input, message));
  }

  /** The client has sent its last message. */
  halfClose(): void {
    this.write(FrameKind.HalfClose, new Uint8Array());
  }

  /** Ends the call at once; its handlers are told nothing more. */
  cancel(): void {
    if (this.over) return;
    this.over = true;
    this.socket.close(1000);
  }

  private write(kind: FrameKind, payload: Uint8Array): void {
    if (this.over) return;
    const frame = encodeFrame(kind, payload);
    if (this.waiting === null) this.socket.send(frame);
    else this.waiting.push(frame);
  }

  private open(): void {
    const waiting = this.waiting ?? [];
    this.waiting = null;
    if (!this.over) waiting.forEach((frame) => this.socket.send(frame));
  }

  private receive(data: unknown): void {
    if (this.over) return;
    try {
      if (!(data instanceof ArrayBuffer)) throw new Error("the gateway sent text");
      const frame = decodeFrame(data);
      if (frame.kind === FrameKind.End) this.endWith(frame.payload);
      else if (frame.kind === FrameKind.Begin) this.handlers.onBegin?.(fromBinary(GatewayCallBeginSchema, frame.payload).headers);
      else if (frame.kind === FrameKind.Message) {
        this.handlers.onMessage(fromBinary(this.method.output, frame.payload) as MessageShape<M["output"]>, frame);
      } else throw new Error(`a frame of kind ${frame.kind} came, which only clients send`);
    } catch (thrown) {
      const text = thrown instanceof Error ? thrown.message : String(thrown);
      this.end(thrown instanceof CallError ? thrown : new CallError(Code.DataLoss, text));
    }
  }

  private endWith(payload: Uint8Array): void {
    const end = fromBinary(GatewayCallEndSchema, payload);
    this.end(end.code === 0 ? null : callErrorOf(end.code, end.message, end.statusDetails));
  }

  private end(error: CallError | null): void {
    if (this.over) return;
    this.over = true;
    this.socket.close(1000);
    this.handlers.onEnd(error);
  }
}

function closedError(code: number): CallError {
  const text = code === 1009 ? "a message was too large for the gateway" : "the connection to the gateway broke off";
  return new CallError(code === 1009 ? Code.ResourceExhausted : Code.Unavailable, text);
}
