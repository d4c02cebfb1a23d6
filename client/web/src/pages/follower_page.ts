// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type CallError, Code, messageOf, toCallError } from "../calls/call_error";
import { type Gateway, sessionMetadata } from "../calls/gateway";
import type { CaseFile } from "../case/case_file";
import { WatchOrigin } from "../generated/tissueform/v1/deform_service_pb";
import type { Pose } from "../geometry/pose";
import { pointAt, rigidPose } from "../geometry/rigid_fit";
import { FollowSession, type FollowedPicture } from "../live/follow_session";
import { type Connection, Interruption } from "../live/interruption";
import { fromMessages } from "../live/pose_messages";
import { el } from "../panels/dom";
import { lookByKey } from "../panels/keyboard";
import { noticeBox, statusBar, timeText } from "../panels/status_bar";
import { viewBar } from "../panels/view_bar";
import type { HeadView } from "../scene/head_view";
import { followedRest } from "../workbench/face_colors";
import { pictureBox } from "./planner_page";

/** A read-only page that shows what a planner's page shows. */
export function followerPage(gateway: Gateway, file: CaseFile, session: string, link: { endsAt: Date | null; account: HTMLElement | null }): { element: HTMLElement; follower: Follower } {
  const notice = noticeBox();
  const { element: picture, view } = pictureBox(file, notice.show);
  const status = statusBar(`${file.manifest.title === "" ? "Case" : file.manifest.title}, followed`, { links: null, onLeave: null, onRetry: null, account: link.account });
  if (link.endsAt !== null) status.element.append(el("span", { class: "quiet", text: `Link works until ${timeText(link.endsAt)}` }));
  status.connection({ kind: "preparing", text: "Joining", share: null });
  const follower = new Follower(gateway, file, session, view, {
    onConnection: (connection) => status.connection(connection),
    onEnd: (text) => status.connection({ kind: "failed", text }),
    onNotice: notice.show,
  });
  view.stage.surface.addEventListener("keydown", (event) => {
    if (lookByKey(view, event)) event.preventDefault();
  });
  picture.append(notice.element);
  return { element: el("div", { class: "planner following" }, [status.element, el("main", {}, [picture, viewBar(view)])]), follower };
}

/** Why there is nothing more to see, as a sentence. */
export function endOfWatch(error: CallError): string {
  if (error.code === Code.Unauthenticated) return LINK_HAS_ENDED;
  return error.reason === "SESSION_NOT_FOUND" ? "The session that you followed has ended." : messageOf(error);
}

export const LINK_HAS_ENDED = "The link has expired or was revoked. Ask its sender for a new one.";

interface FollowerListener {
  onConnection(connection: Connection): void;
  onEnd(text: string): void;
  onNotice(text: string): void;
}

/** Lays what a watch reports upon the head. Where bone is it learns from three vertices of each segment, else from committed poses. */
export class Follower {
  /** Of the newest picture, as it came. */
  positions = new Float32Array();
  number = 0n;
  private readonly rest: Float32Array;
  private readonly displacements: Float32Array;
  private readonly places: Map<number, number>;

  constructor(
    private readonly gateway: Gateway,
    private readonly file: CaseFile,
    private readonly session: string,
    readonly view: HeadView,
    private readonly listener: FollowerListener,
  ) {
    this.rest = followedRest(file);
    this.displacements = new Float32Array(this.rest.length);
    this.places = new Map(Array.from(file.followed, (vertex, place) => [vertex, place]));
    const interruption = new Interruption(gateway.routes);
    new FollowSession(gateway, session, {
      onStarted: () => {
        interruption.end();
        listener.onConnection({ kind: "live" });
      },
      onWaiting: (isWaiting) => listener.onConnection({ kind: isWaiting ? "waiting" : "live" }),
      onPicture: (picture, used) => this.show(picture, used),
      onNotice: ({ notice }) => {
        if (notice.case === "draining" && !gateway.routes.isCluster) listener.onNotice("The server is shutting down; the page reconnects automatically.");
        if (notice.case === "evicted") listener.onNotice("The session is being prepared again.");
      },
      onBroken: (error) => listener.onConnection(interruption.connection(error)),
      onEnd: (error) => listener.onEnd(endOfWatch(error)),
    });
  }

  private show(picture: FollowedPicture, used: () => void): void {
    this.positions = new Float32Array(picture.positions);
    this.number = picture.frame.number;
    const count = picture.vertices.length === 0 ? this.file.manifest.mesh.vertexCount : picture.vertices.length;
    if (picture.positions.length !== 3 * count) throw new Error("a frame has another number of vertices than stated");
    this.displacements.fill(0);
    for (let i = 0; i < count; ++i) {
      const place = this.places.get(picture.vertices.length === 0 ? i : picture.vertices[i]);
      if (place === undefined) continue;
      for (let k = 0; k < 3; ++k) this.displacements[3 * place + k] = picture.positions[3 * i + k] - this.rest[3 * place + k];
    }
    this.view.head.setDisplacements(this.displacements);
    if (picture.origin === WatchOrigin.COMMITTED) void this.showCommitted();
    else this.view.setPoses(this.fittedPoses());
    this.view.stage.invalidate(used);
  }

  private fittedPoses(): Map<string, Pose> {
    const poses = new Map<string, Pose>();
    this.file.manifest.handles.forEach(({ name }, index) => {
      const places = this.file.probes[index]?.map((vertex) => this.places.get(vertex));
      if (places === undefined || places.some((place) => place === undefined)) return;
      const [a, b, c] = places as [number, number, number];
      const rest = (place: number) => pointAt(this.rest, place);
      const now = (place: number) => {
        const [x, y, z] = pointAt(this.displacements, place);
        const [u, v, w] = rest(place);
        return [x + u, y + v, z + w] as [number, number, number];
      };
      poses.set(name, rigidPose([rest(a), rest(b), rest(c)], [now(a), now(b), now(c)]));
    });
    return poses;
  }

  private async showCommitted(): Promise<void> {
    try {
      const session = await this.gateway.sessions.getSession({ name: this.session }, { headers: sessionMetadata(this.session) });
      this.view.setPoses(fromMessages(session.committedPoses));
    } catch (thrown) {
      this.listener.onNotice(`The position of the bone is unknown. ${messageOf(toCallError(thrown))}`);
    }
  }
}
