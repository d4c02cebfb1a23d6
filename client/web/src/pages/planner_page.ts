// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { Gateway } from "../calls/gateway";
import type { CaseFile } from "../case/case_file";
import { type ContactChoice, modelsOf } from "../case/contact_choice";
import { FollowLinks } from "../live/follow_links";
import { button, el, throttleToFrame } from "../panels/dom";
import { exportPanel } from "../panels/export_panel";
import { jawPanel } from "../panels/jaw_panel";
import { contactPart } from "../panels/contact_part";
import { bindKeys, helpDialog } from "../panels/keyboard";
import { legendBox, mapPanel, modelPanel } from "../panels/maps_panel";
import { measuresPanel } from "../panels/measures_panel";
import { movementsPanel } from "../panels/movements_panel";
import { bindPicking, pickingBox } from "../panels/picking";
import { photographPanel } from "../panels/photograph_panel";
import { PictureBox } from "../panels/picture_box";
import { predictionsPanel } from "../panels/predictions_panel";
import { profilePanel } from "../panels/profile_panel";
import { reportPanel } from "../panels/report_panel";
import { segmentsPanel } from "../panels/segments_panel";
import { sideBySideButton } from "../panels/side_by_side_button";
import { slicesButton } from "../panels/slices_button";
import { noticeBox, statusBar } from "../panels/status_bar";
import { viewBar } from "../panels/view_bar";
import { targetPanel } from "../panels/target_panel";
import { HeadView } from "../scene/head_view";
import { Workbench } from "../workbench/workbench";
import type { ModelInfo } from "../generated/tissueform/v1/server_info_pb";

/** Where a head is drawn; both pages with a head have it. */
export function pictureBox(file: CaseFile, onNotice: (text: string) => void): { element: HTMLElement; view: HeadView } {
  const box = new PictureBox((isLost) => !isLost && onNotice("The picture is back."));
  const view = new HeadView(box.element, file, box.listener);
  box.dress(view, "3D view of the head. Press ? for keyboard shortcuts.");
  return { element: box.element, view };
}

/** An answer that takes longer than this is waited for in words. */
const LATE_MS = 500;

/** What a page is given by who opens it. */
export interface PageParts {
  /** Makes the address of a follower's page. */
  followUrl(sessionOrToken: string): string;
  /** Whether the server knows who calls: then links are of tokens that end. */
  hasLogins: boolean;
  account: HTMLElement | null;
  /** Leaves for the same case with tissue that sticks, or with lips that part. */
  chooseContact(choice: ContactChoice): Promise<void>;
}

/** The planner of one case. */
export function plannerPage(
  gateway: Gateway,
  file: CaseFile,
  caseName: string,
  models: readonly ModelInfo[],
  { followUrl, hasLogins, account, chooseContact }: PageParts,
  onLeave: () => void,
): { element: HTMLElement; bench: Workbench } {
  const notice = noticeBox();
  const { element: picture, view } = pictureBox(file, notice.show);
  const bench = new Workbench(gateway, file, caseName, view, modelsOf(file, models));
  const leave = () => void bench.live.end().then(onLeave);
  const links = new FollowLinks(gateway, hasLogins, caseName, () => bench.live.session, followUrl);
  const title = file.manifest.title === "" ? "Case" : file.manifest.title;
  const status = statusBar(title, { links, onLeave: leave, onRetry: () => void bench.live.retry(), account });
  bench.connection.watch(status.connection);
  bench.followers.watch(status.followers);
  const showAge = () => {
    if (bench.waitingMs > LATE_MS) status.waiting(bench.waitingMs);
    else if (bench.picture.value !== null) status.answered(bench.picture.value.roundTripMs);
  };
  bench.picture.watch(throttleToFrame(showAge));
  setInterval(showAge, LATE_MS);
  bench.notice.watch(notice.show);

  const help = helpDialog();
  bindKeys(bench, help);
  bindPicking(bench);
  picture.append(gizmoModes(bench, help), pickingBox(bench), notice.element);
  const panel = el("aside", { attributes: { "aria-label": "Plan" } }, [
    segmentsPanel(bench),
    movementsPanel(bench),
    measuresPanel(bench),
    profilePanel(bench),
    targetPanel(bench),
    jawPanel(bench),
    modelPanel(bench, contactPart(bench, chooseContact)),
    mapPanel(bench),
    photographPanel(bench),
    predictionsPanel(bench),
    exportPanel(bench),
    reportPanel(bench),
  ]);
  const bar = viewBar(view);
  const main = el("main", {}, [picture, legendBox(bench), bar]);
  bar.append(slicesButton(bench, main), sideBySideButton(bench));
  const element = el("div", { class: "planner" }, [status.element, main, panel, help]);
  return { element, bench };
}

function gizmoModes(bench: Workbench, help: HTMLDialogElement): HTMLElement {
  const move = button("Move", () => set(true));
  const rotate = button("Rotate", () => set(false));
  const set = (isMove: boolean) => {
    bench.gizmo.setMode(isMove ? "translate" : "rotate");
    move.setAttribute("aria-pressed", String(isMove));
    rotate.setAttribute("aria-pressed", String(!isMove));
  };
  set(true);
  const keys = button("Shortcuts", () => help.showModal());
  return el("div", { class: "gizmo-modes", attributes: { role: "group", "aria-label": "Gizmo" } }, [move, rotate, keys]);
}
