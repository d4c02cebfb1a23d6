// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { create } from "@bufbuild/protobuf";
import { CallError, Code, toCallError } from "../calls/call_error";
import type { CallSocket } from "../calls/call_socket";
import { type Frame, asFloats } from "../calls/frame";
import { type Gateway, sessionMetadata } from "../calls/gateway";
import {
  type DeformNotice,
  DeformService,
  type WatchForm,
  type WatchFrame,
  WatchOrigin,
  WatchRequestSchema,
  type WatchResponse,
} from "../generated/tissueform/v1/deform_service_pb";
import { PositionEncoding } from "../generated/tissueform/v1/geometry_pb";
import { Backoff, type Timer, browserTimer } from "../calls/backoff";

/** What a follower is shown. */
export interface FollowedPicture {
  frame: WatchFrame;
  origin: WatchOrigin;
  /** Vertices of the tet mesh in the order of `positions`; empty: all. */
  vertices: number[];
  positions: Float32Array;
}

export interface FollowListener {
  /** `used` is to be called once the picture was shown. */
  onPicture(picture: FollowedPicture, used: () => void): void;
  onNotice(notice: DeformNotice): void;
  onStarted(): void;
  /** The gateway gives no sign of life; then, that it does. */
  onWaiting(isWaiting: boolean): void;
  onBroken(error: CallError, delayMs: number): void;
  onEnd(error: CallError): void;
}

const ACKNOWLEDGE_MS = 8000;
const ACKNOWLEDGE_AGAIN_MS = 1000;
/** For so long after a break a drag that was seen is waited for, before what was last committed is shown. */
const DRAG_RETURNS_MS = 5000;

/**
 * Follows a session that another user drags; opens the watch again where the connection breaks off. A server that has just
 * taken the session begins with what was committed: the face stays as it was until the drag is back.
 */
export class FollowSession {
  private readonly unwatch: () => void;
  private call: CallSocket<typeof DeformService.method.watch> | null = null;
  private stopTimer: (() => void) | null = null;
  private readonly backoff = new Backoff();
  private isClosed = false;
  private watch = "";
  private form: WatchForm | null = null;
  /** The newest picture that was shown; null: none yet. */
  private used: bigint | null = null;
  /** Whether the newest picture is of a drag, and a drag has not come back since the watch broke off. */
  private isOfDrag = false;
  private awaitsDrag = false;
  /** Forgets the picture that waits for that. */
  private stopWaiting: (() => void) | null = null;

  constructor(
    private readonly gateway: Pick<Gateway, "open" | "bearer"> & { deform: Pick<Gateway["deform"], "acknowledgeWatch"> },
    private readonly session: string,
    private readonly listener: FollowListener,
    private readonly timer: Timer = browserTimer,
  ) {
    this.unwatch = gateway.bearer.watch((token) => this.renew(token));
    this.connect();
  }

  /** The listener is not called afterwards. */
  close(): void {
    this.isClosed = true;
    this.unwatch();
    this.stopTimer?.();
    this.stopWaiting?.();
    this.call?.cancel();
  }

  private connect(): void {
    this.call = this.gateway.open(
      DeformService.method.watch,
      {
        onMessage: (message, frame) => this.receive(message, frame),
        onQuiet: (isQuiet) => this.listener.onWaiting(isQuiet),
        onEnd: (error) => this.broken(error),
      },
      { metadata: sessionMetadata(this.session) },
    );
    this.call.send(create(WatchRequestSchema, { session: this.session }));
    this.call.halfClose();
  }

  private receive(response: WatchResponse, raw: Frame): void {
    const { message } = response;
    if (message.case === "started") {
      this.watch = message.value.watch;
      this.used = null;
      this.awaitsDrag = this.isOfDrag;
      this.form = message.value.form ?? null;
      this.backoff.succeeded();
      this.listener.onStarted();
    } else if (message.case === "form") this.form = message.value;
    else if (message.case === "frame") this.show(message.value, raw);
    else if (message.case === "notice") this.listener.onNotice(message.value);
  }

  private show(frame: WatchFrame, raw: Frame): void {
    if (frame.frame === undefined || this.form === null) return;
    if (this.form.encoding === PositionEncoding.INT16_ZSTD) {
      throw new CallError(Code.Unimplemented, "this session's frames are compressed, and this page cannot unpack them: ask for another link");
    }
    const positions = asFloats(raw, frame.frame.positions);
    const watch = this.watch;
    const picture = { frame, origin: frame.origin, vertices: this.form.vertices, positions };
    const used = () => {
      if (watch === this.watch) this.used = frame.number;
      this.acknowledge(watch, frame.number);
    };
    const deliver = () => {
      this.isOfDrag = frame.origin === WatchOrigin.DRAG;
      this.awaitsDrag = false;
      this.listener.onPicture(picture, used);
    };
    this.stopWaiting?.();
    if (this.awaitsDrag && frame.origin !== WatchOrigin.DRAG) this.stopWaiting = this.timer(deliver, DRAG_RETURNS_MS);
    else deliver();
  }

  // A watch that has ended needs no acknowledgment; its end arrives by itself. The server waits for one that was lost,
  // so the newest one is repeated.
  private acknowledge(watch: string, number: bigint): void {
    const options = { headers: sessionMetadata(this.session), timeoutMs: ACKNOWLEDGE_MS };
    this.gateway.deform.acknowledgeWatch({ watch, number }, options).catch((thrown) => {
      const isNewest = () => !this.isClosed && watch === this.watch && number === this.used;
      if (!toCallError(thrown).isPassing || !isNewest()) return;
      this.timer(() => isNewest() && this.acknowledge(watch, number), ACKNOWLEDGE_AGAIN_MS);
    });
  }

  // A watch depends on the token of its newest acknowledgment. Without frames no other is sent, so it is repeated.
  private renew(token: string): void {
    if (token !== "" && this.used !== null) this.acknowledge(this.watch, this.used);
  }

  private broken(error: CallError | null): void {
    if (this.isClosed) return;
    this.stopWaiting?.();
    const cause = error ?? new CallError(Code.Unavailable, "the server has stopped the watch");
    if (!cause.isPassing) {
      this.isClosed = true;
      this.unwatch();
      this.listener.onEnd(cause);
      return;
    }
    const delay = this.backoff.next(cause);
    this.stopTimer = this.timer(() => this.connect(), delay);
    this.listener.onBroken(cause, delay);
  }
}
