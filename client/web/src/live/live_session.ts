// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type CallError, Code, messageOf, toCallError } from "../calls/call_error";
import type { Gateway } from "../calls/gateway";
import type { CaseFile } from "../case/case_file";
import type { DeformConfiguration, DeformNotice } from "../generated/tissueform/v1/deform_service_pb";
import type { DeformationModel, Session } from "../generated/tissueform/v1/session_pb";
import type { Pose } from "../geometry/pose";
import { Backoff } from "../calls/backoff";
import { DragSession, type DisplayedFrame } from "./drag_session";
import { type Connection, Interruption } from "./interruption";
import { fromMessages, toMessages } from "./pose_messages";
import { claimSession, forgetAbandoned, forgetSession, newSession } from "./session_memory";
import { type DragChoice, createSession, deleteSession, dragConfiguration, openSession } from "./session_opening";

export type { Connection } from "./interruption";

export interface LiveListener {
  onConnection(connection: Connection): void;
  onPicture(picture: DisplayedFrame, used: () => void): void;
  /** Poses that the session had before, when it is opened again. */
  onCommittedPoses(poses: Map<string, Pose>): void;
  onFollowers(count: number): void;
  /** The drag goes on with this; again after every break. */
  onStarted(configuration: DeformConfiguration): void;
  /** The session is made from something else now. */
  onUpdated(): void;
  /** A sentence that the planner should read. */
  onNotice(text: string): void;
}

/** How often one attempt may be repaired (created again, opened instead, without prepared answers) before it is reported as failed. */
const MOST_MENDED = 4;

/**
 * The session of this tab for one case: opened again where it was left, created again where the server has lost it, with one drag on
 * it whose model may change. The connection's state reports errors; nothing is thrown.
 */
export class LiveSession {
  session = "";
  private drag: DragSession | null = null;
  private poses: Pose[] = [];
  private hasUnkeptPoses = false;
  /** Which attempt is the newest: older ones give up when they see another. */
  private attempt = 0;
  private readonly names: string[];
  private readonly interruption: Interruption;

  constructor(
    private readonly gateway: Gateway,
    private readonly file: CaseFile,
    private readonly caseName: string,
    private readonly listener: LiveListener,
    private choice: DragChoice,
  ) {
    this.interruption = new Interruption(gateway.routes);
    this.names = file.manifest.handles.map((handle) => handle.name);
  }

  async start(poses: Pose[]): Promise<void> {
    this.poses = poses;
    this.listener.onConnection({ kind: "preparing", text: "Opening the session", share: null });
    const claim = await claimSession(this.caseName);
    this.session = claim.session;
    void this.deleteAbandoned();
    const session = await this.connect(claim.isOld);
    if (session !== null && session.committedPoses.length > 0) this.listener.onCommittedPoses(fromMessages(session.committedPoses));
  }

  /** `isFinal`: the movement ends, and the server keeps the poses. */
  sendPoses(poses: Pose[], isFinal: boolean): void {
    this.poses = poses;
    if (this.drag === null) this.hasUnkeptPoses ||= isFinal;
    else this.drag.sendPoses(toMessages(this.names, poses), isFinal);
  }

  /** The drag goes on with this model, once it is ready. */
  async choose(choice: DragChoice): Promise<void> {
    this.choice = choice;
    if (this.session !== "") await this.connect(true);
  }

  /** Once more, after what had failed. */
  async retry(): Promise<void> {
    await this.connect(true);
  }

  get model(): DeformationModel | undefined {
    return this.choice.model;
  }

  /** Whether the server has said that it keeps the newest poses. */
  get isKept(): boolean {
    return !this.hasUnkeptPoses && this.drag?.isCommitted === true;
  }

  /** The planner is done with the case: the session ends on the server, too. */
  async end(): Promise<void> {
    this.attempt += 1;
    this.drag?.close();
    forgetSession(this.session);
    await deleteSession(this.gateway, this.session).catch(() => {});
  }

  /** Ready for poses, or null where that failed or something newer has begun. */
  private async connect(exists: boolean): Promise<Session | null> {
    const attempt = ++this.attempt;
    const isOver = () => attempt !== this.attempt;
    const backoff = new Backoff();
    let isThere = exists;
    // Taken and yet missing: it belongs to the user who was signed in here before.
    let wasMissing = false;
    for (let mended = 0; ; ) {
      try {
        const session = await this.prepare(isThere, isOver);
        if (isOver()) return null;
        this.begin();
        return session;
      } catch (thrown) {
        if (isOver()) return null;
        const error = toCallError(thrown);
        if (error.isPassing) await this.wait(error, backoff.next(error));
        else if (++mended > MOST_MENDED) return this.fail(error);
        else if (isThere && error.code === Code.NotFound) [isThere, wasMissing] = [false, true];
        else if (error.reason === "NO_PREPARED_ANSWERS" && this.choice.isPrepared) this.choice = { ...this.choice, isPrepared: false, ranges: null };
        else if (error.reason === "SESSION_ID_TAKEN" && wasMissing) this.session = await newSession(this.caseName);
        else if (error.reason === "SESSION_ID_TAKEN") isThere = true;
        else return this.fail(error);
        if (isOver()) return null;
      }
    }
  }

  private fail(error: CallError): null {
    this.listener.onConnection({ kind: "failed", text: messageOf(error) });
    return null;
  }

  private prepare(exists: boolean, isOver: () => boolean): Promise<Session> {
    const configuration = dragConfiguration(this.session, this.file, this.choice);
    const onStage = (text: string, share: number | null) => {
      if (!isOver()) this.listener.onConnection({ kind: "preparing", text, share });
    };
    if (exists) return openSession(this.gateway, this.session, configuration, onStage);
    return createSession(this.gateway, this.file, configuration, onStage);
  }

  private async wait(error: CallError, delayMs: number): Promise<void> {
    // A hop to the server that was named is not worth a word.
    if (delayMs > 0) this.listener.onConnection(this.interruption.connection(error));
    await new Promise((resolve) => setTimeout(resolve, delayMs));
  }

  private begin(): void {
    const isUnkept = this.hasUnkeptPoses || this.drag?.isCommitted === false;
    this.drag?.close();
    this.hasUnkeptPoses = false;
    const configuration = dragConfiguration(this.session, this.file, this.choice);
    this.drag = new DragSession(this.gateway, configuration, {
      onStarted: () => {
        this.interruption.end();
        this.listener.onConnection({ kind: "live" });
        this.listener.onStarted(configuration);
      },
      onPicture: (picture, used) => this.listener.onPicture(picture, used),
      onNotice: (notice) => this.notify(notice),
      onWaiting: (isWaiting) => this.listener.onConnection({ kind: isWaiting ? "waiting" : "live" }),
      onBroken: (error) => this.listener.onConnection(this.interruption.connection(error)),
      onEnd: (error) => this.dragEnded(error),
    });
    this.drag.sendPoses(toMessages(this.names, this.poses), isUnkept);
  }

  private dragEnded(error: CallError): void {
    this.hasUnkeptPoses = true;
    if (error.code === Code.NotFound) {
      this.listener.onNotice("The server lost the session; it is being created again.");
      void this.connect(false);
    } else if (error.reason === "SESSION_UPDATED") void this.startAnew();
    else this.listener.onConnection({ kind: "failed", text: messageOf(error) });
  }

  private async startAnew(): Promise<void> {
    this.listener.onNotice("Another user changed the session's segments; you continue in your own session.");
    this.session = await newSession(this.caseName);
    await this.connect(false);
  }

  private notify({ notice }: DeformNotice): void {
    if (notice.case === "followers") this.listener.onFollowers(notice.value.count);
    // In a cluster another server goes on with it, which the connection's state shows.
    if (notice.case === "draining" && !this.gateway.routes.isCluster) this.listener.onNotice("The server is shutting down. Your poses are kept; the page reconnects automatically.");
    if (notice.case === "evicted") this.listener.onNotice("The session was evicted from the server's memory and is being prepared again.");
    if (notice.case === "restored") this.listener.onNotice("The session is back in the server's memory.");
    if (notice.case === "updated") {
      this.listener.onNotice("The session was updated: the face shows the new one.");
      this.listener.onUpdated();
    }
    if (notice.case === "committed" && notice.value.failure !== "") this.listener.onNotice(`The server could not store the poses: ${messageOf(notice.value.failure)}`);
  }

  private async deleteAbandoned(): Promise<void> {
    for (const session of await forgetAbandoned(this.session)) await deleteSession(this.gateway, session).catch(() => {});
  }
}
