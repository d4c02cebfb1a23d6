// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { create } from "@bufbuild/protobuf";
import { CallError, Code } from "../calls/call_error";
import type { CallSocket } from "../calls/call_socket";
import { type Frame, asFloats } from "../calls/frame";
import { type Gateway, sessionMetadata } from "../calls/gateway";
import {
  type DeformConfiguration,
  type DeformFrame,
  type DeformNotice,
  type DeformResponse,
  DeformRequestSchema,
  DeformService,
  type DeformStarted,
} from "../generated/tissueform/v1/deform_service_pb";
import type { HandlePose } from "../generated/tissueform/v1/geometry_pb";
import { Backoff, type Timer, browserTimer } from "../calls/backoff";

/** A frame as the page shows it. */
export interface DisplayedFrame {
  frame: DeformFrame;
  /** Three of each vertex of the configuration, mm. */
  positions: Float32Array;
  /** One of each vertex, mm; null where the frame has none. */
  uncertainty: Float32Array | null;
  /** From sending its pose to now. */
  roundTripMs: number;
  /** How many poses are newer than the one that it answers. */
  posesBehind: number;
}

/** What a drag reports to its owner. */
export interface DragListener {
  onStarted(started: DeformStarted): void;
  /** `used` is to be called once the picture was shown: the server waits for it. */
  onPicture(picture: DisplayedFrame, used: () => void): void;
  onNotice(notice: DeformNotice): void;
  /** The newest poses or their commit have had no answer for 2 s, or the gateway gives no sign of life; then, that they have. */
  onWaiting(isWaiting: boolean): void;
  /** The connection broke off; the drag goes on in `delayMs`. */
  onBroken(error: CallError, delayMs: number): void;
  /** The drag is over, for a reason that another try does not fix. */
  onEnd(error: CallError): void;
}

/** What the server takes where the configuration does not say. */
const DEFAULT_MAX_UNACKED = 2;
/** Answers that were not acknowledged by a picture of this age are no longer waited for. */
const KEPT_SEND_TIMES = 256;

/**
 * A drag of one session over one socket at a time: the newest poses are sent, frames come back, and where the connection breaks
 * off, or poses and commits have no answer for too long, another one is opened, which is sent the newest poses again. Commits are
 * repeated until the server says that it keeps them.
 */
export class DragSession {
  private readonly unwatch: () => void;
  private call: CallSocket<typeof DeformService.method.deform> | null = null;
  private stopTimer: (() => void) | null = null;
  private readonly backoff: Backoff;
  private isClosed = false;
  private isStarted = false;
  /** The token that the open call stands on. */
  private sentToken = "";

  private sequence = 0n;
  private poses: HandlePose[] | null = null;
  /** Of the newest pose that is to be kept and of which the server has not said so. */
  private uncommitted: bigint | null = null;
  /** Of the newest pose that was sent over the open call, and of the newest frame that came over it. */
  private sent = 0n;
  private answered = 0n;
  /** Frames that the page has not shown yet: the server makes no more than `maxUnacked` of them. */
  private unused = 0;
  /** The session has left the server's memory; that it comes back may take minutes. */
  private isAway = false;
  private readonly sendTimes = new Map<bigint, number>();

  constructor(
    private readonly gateway: Pick<Gateway, "open" | "bearer">,
    private readonly configuration: DeformConfiguration,
    private readonly listener: DragListener,
    private readonly timer: Timer = browserTimer,
    private readonly now: () => number = () => performance.now(),
  ) {
    this.backoff = new Backoff(Math.random, now);
    this.unwatch = gateway.bearer.watch((token) => this.renew(token));
    this.connect();
  }

  /** Replaces poses that wait. `commit`: they are to be kept, as at the end of a movement. */
  sendPoses(poses: HandlePose[], commit: boolean): void {
    this.poses = poses;
    this.sequence += 1n;
    if (commit) this.uncommitted = this.sequence;
    // Without a server that listens the newest poses wait: they are sent when it does.
    if (this.isStarted) this.sendNewest(commit);
  }

  /** Whether the newest poses are known to be kept. */
  get isCommitted(): boolean {
    return this.uncommitted === null;
  }

  /** The listener is not called afterwards. */
  close(): void {
    this.isClosed = true;
    this.unwatch();
    this.stopTimer?.();
    this.call?.cancel();
  }

  private connect(): void {
    this.isStarted = false;
    [this.sent, this.answered, this.unused, this.isAway] = [0n, 0n, 0, false];
    this.sentToken = this.gateway.bearer.token;
    const call = this.gateway.open(
      DeformService.method.deform,
      {
        onMessage: (message, frame) => this.receive(message, frame),
        onQuiet: (isQuiet) => this.isStarted && this.listener.onWaiting(isQuiet),
        onEnd: (error) => this.broken(error),
      },
      { metadata: sessionMetadata(this.configuration.session) },
    );
    call.send(create(DeformRequestSchema, { message: { case: "configuration", value: this.configuration } }));
    this.call = call;
  }

  // The open drag stands on the new token from now on.
  private renew(token: string): void {
    if (token === "" || token === this.sentToken || !this.isStarted) return;
    this.sentToken = token;
    this.call?.send(create(DeformRequestSchema, { message: { case: "token", value: token } }));
  }

  private sendNewest(commit: boolean): void {
    if (this.poses === null) return;
    this.sendTimes.set(this.sequence, this.now());
    if (this.sendTimes.size > KEPT_SEND_TIMES) this.sendTimes.delete(this.sendTimes.keys().next().value ?? 0n);
    const value = { $typeName: "tissueform.v1.PoseUpdate" as const, sequence: this.sequence, poses: this.poses, commit };
    this.call?.send(create(DeformRequestSchema, { message: { case: "pose", value } }));
    this.sent = this.sequence;
    this.judgeAnswers();
  }

  private judgeAnswers(): void {
    const hasRoom = this.unused < (this.configuration.maxUnacked ?? DEFAULT_MAX_UNACKED);
    const isOwed = this.uncommitted !== null || (hasRoom && this.answered < this.sent);
    if (this.call !== null) this.call.awaitsAnswer = isOwed && !this.isAway;
  }

  private receive(response: DeformResponse, frame: Frame): void {
    const { message } = response;
    if (message.case === "started") this.start(message.value);
    else if (message.case === "frame") this.show(message.value, frame);
    else if (message.case === "notice") this.notice(message.value);
    this.judgeAnswers();
  }

  private start(started: DeformStarted): void {
    this.isStarted = true;
    this.renew(this.gateway.bearer.token);
    this.backoff.succeeded();
    this.listener.onStarted(started);
    this.sendNewest(this.uncommitted !== null);
  }

  private show(frame: DeformFrame, raw: Frame): void {
    const uncertainty = frame.uncertaintyP95Mm.length === 0 ? null : asFloats(raw, frame.uncertaintyP95Mm);
    const picture = {
      frame,
      positions: asFloats(raw, frame.positions),
      uncertainty,
      roundTripMs: this.now() - (this.sendTimes.get(frame.sequence) ?? this.now()),
      posesBehind: Number(this.sequence - frame.sequence),
    };
    const call = this.call;
    [this.answered, this.isAway] = [frame.sequence, false];
    this.unused += 1;
    this.listener.onPicture(picture, () => {
      if (call === this.call) {
        this.unused = 0; // an acknowledgement stands for those before it
        this.judgeAnswers();
      }
      const value = { $typeName: "tissueform.v1.FrameAck" as const, sequence: frame.sequence, refinement: frame.refinement };
      call?.send(create(DeformRequestSchema, { message: { case: "ack", value } }));
    });
  }

  private notice(notice: DeformNotice): void {
    const { notice: what } = notice;
    if (what.case === "committed" && this.uncommitted !== null && what.value.sequence >= this.uncommitted) this.uncommitted = null;
    if (what.case === "evicted" || what.case === "restored") this.isAway = what.case === "evicted";
    this.listener.onNotice(notice);
  }

  private broken(error: CallError | null): void {
    if (this.isClosed) return;
    this.isStarted = false;
    const cause = error ?? new CallError(Code.Unavailable, "the server has stopped the drag");
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
