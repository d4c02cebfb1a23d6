// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { create, fromBinary, toBinary, type DescMethod, type MessageShape } from "@bufbuild/protobuf";
import { GatewayCallBeginSchema, GatewayCallEndSchema, GatewayCallStartSchema } from "../generated/tissueform/v1/gateway_pb";
import { type Timer, browserTimer } from "./backoff";
import { CallError, Code, callErrorOf } from "./call_error";
import { type Frame, FrameKind, decodeFrame, encodeFrame } from "./frame";
import { Patience, SilenceClock } from "./silence";

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

/** What a call reports to its owner. It reports nothing after `onEnd`, and nothing after `cancel`. */
export interface CallHandlers<Response> {
  /** What the server says of itself before its first message, by names in lower case; not called where it says nothing. */
  onBegin?(headers: Record<string, string>): void;
  /** A message of the server, with the frame that it lies in. */
  onMessage(message: Response, frame: Frame): void;
  /** What is waited for has not come for a while: an answer for 2 s, any sign of the gateway for 5 s. Then, that it has. */
  onQuiet?(isQuiet: boolean): void;
  /** Once: null when the call ended well. */
  onEnd(error: CallError | null): void;
}

export interface CallOptions {
  /** Names in lower case, as docs/gateway.md lists them. */
  metadata?: Record<string, string>;
  /** From now; left out: none. */
  deadlineMs?: number;
  /** Of this call and those like it. */
  patience?: Patience;
  timer?: Timer;
}

/** Reasons of the error of a socket that never opened, and why; no server says them. */
export const NOT_OPENED = "SOCKET_NOT_OPENED";
export const BLOCKED = "SOCKETS_BLOCKED";

/** With which a socket is closed that was sent too much. */
const TOO_LARGE = 1009;
const QUIET_ANSWER_S = 2;
/** More than the gateway takes from one heartbeat to the next. */
const QUIET_GATEWAY_S = 5;

/**
 * One call of any kind over one WebSocket of the gateway. What is sent before the socket is open waits for that. A frame that is
 * none, or a handler that throws, ends the call with an error; so does a socket that closes without an end, and one that is open
 * and dead: the gateway's heartbeats do not come, or an answer that the owner waits for.
 */
export class CallSocket<M extends DescMethod> {
  private readonly socket: Socket;
  private waiting: Uint8Array<ArrayBuffer>[] | null = [];
  private over = false;
  private isOpened = false;
  private hasHeartbeat = false;
  private isAwaited = false;
  private isQuiet = false;
  private readonly patience: Patience;
  private readonly clock: SilenceClock;

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
    this.socket.onclose = (event) => this.end(this.isOpened || event.code === TOO_LARGE ? closedError(event.code) : notOpened());
    const start = create(GatewayCallStartSchema, {
      method: `/${method.parent.typeName}/${method.name}`,
      metadata: options.metadata ?? {},
      deadlineMs: BigInt(Math.ceil(options.deadlineMs ?? 0)),
      tellsBegin: handlers.onBegin !== undefined,
      wantsHeartbeat: true,
    });
    this.patience = options.patience ?? new Patience();
    // A gateway that sends no heartbeat is older than they are.
    const isListening = () => !this.isOpened || this.hasHeartbeat || this.isAwaited;
    this.clock = new SilenceClock(this.patience, options.timer ?? browserTimer, isListening, (silentS) => this.silent(silentS));
    this.write(FrameKind.Start, toBinary(GatewayCallStartSchema, start));
  }

  /** Bytes that were sent and have not left the page. */
  get bufferedBytes(): number {
    return this.socket.bufferedAmount;
  }

  get isOver(): boolean {
    return this.over;
  }

  /** The server owes an answer: until a message comes, signs of the gateway alone do not count. */
  set awaitsAnswer(isAwaited: boolean) {
    if (isAwaited && !this.isAwaited && !this.over) this.clock.restart();
    if (!isAwaited && this.isAwaited) this.patience.answered();
    this.isAwaited = isAwaited;
  }

  /** Nothing happens after the call's end. */
  send(message: MessageShape<M["input"]>): void {
    this.write(FrameKind.Message, toBinary(this.method.input, message));
  }

  /** The client has sent its last message. */
  halfClose(): void {
    this.write(FrameKind.HalfClose, new Uint8Array());
  }

  /** Ends the call at once and calls no more handlers. */
  cancel(): void {
    if (this.over) return;
    this.over = true;
    this.clock.stop();
    this.socket.close(1000);
  }

  private write(kind: FrameKind, payload: Uint8Array): void {
    if (this.over) return;
    const frame = encodeFrame(kind, payload);
    if (this.waiting === null) this.socket.send(frame);
    else this.waiting.push(frame);
  }

  private open(): void {
    this.isOpened = true;
    this.clock.heard();
    const waiting = this.waiting ?? [];
    this.waiting = null;
    if (!this.over) waiting.forEach((frame) => this.socket.send(frame));
  }

  private receive(data: unknown): void {
    if (this.over) return;
    try {
      if (!(data instanceof ArrayBuffer)) throw new Error("the gateway sent text");
      const frame = decodeFrame(data);
      if (frame.kind === FrameKind.Heartbeat) this.hasHeartbeat = true;
      if (frame.kind === FrameKind.Message || !this.isAwaited) this.heard();
      if (frame.kind === FrameKind.End) this.endWith(frame.payload);
      else if (frame.kind === FrameKind.Begin) this.handlers.onBegin?.(fromBinary(GatewayCallBeginSchema, frame.payload).headers);
      else if (frame.kind === FrameKind.Message) {
        this.handlers.onMessage(fromBinary(this.method.output, frame.payload) as MessageShape<M["output"]>, frame);
      } else if (frame.kind !== FrameKind.Heartbeat) throw new Error(`a frame of kind ${frame.kind} came, which only clients send`);
    } catch (thrown) {
      const text = thrown instanceof Error ? thrown.message : String(thrown);
      this.end(thrown instanceof CallError ? thrown : new CallError(Code.DataLoss, text));
    }
  }

  private heard(): void {
    this.clock.heard();
    this.reportQuiet(false);
  }

  private silent(silentS: number): void {
    const limit = this.isOpened ? this.patience.seconds : this.patience.seconds - QUIET_ANSWER_S;
    if (silentS >= limit) {
      this.patience.gaveUp();
      this.end(this.isOpened ? new CallError(Code.Unavailable, `the server has not answered for ${silentS} s`) : notOpened());
    } else if (silentS >= (this.isAwaited ? QUIET_ANSWER_S : QUIET_GATEWAY_S)) this.reportQuiet(true);
  }

  private reportQuiet(isQuiet: boolean): void {
    if (isQuiet === this.isQuiet) return;
    this.isQuiet = isQuiet;
    this.handlers.onQuiet?.(isQuiet);
  }

  private endWith(payload: Uint8Array): void {
    const end = fromBinary(GatewayCallEndSchema, payload);
    this.end(end.code === 0 ? null : callErrorOf(end.code, end.message, end.statusDetails));
  }

  private end(error: CallError | null): void {
    if (this.over) return;
    this.over = true;
    this.clock.stop();
    this.socket.close(1000);
    this.handlers.onEnd(error);
  }
}

function notOpened(): CallError {
  return new CallError(Code.Unavailable, "the connection to the gateway does not open", NOT_OPENED);
}

function closedError(code: number): CallError {
  const text = code === TOO_LARGE ? "a message was too large for the gateway" : "the connection to the gateway broke off";
  return new CallError(code === TOO_LARGE ? Code.ResourceExhausted : Code.Unavailable, text);
}
