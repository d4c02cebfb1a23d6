// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { messageOf } from "../calls/call_error";
import type { Gateway } from "../calls/gateway";
import { type PlanBuild, PlanBuildState } from "../generated/tissueform/v1/plan_build_service_pb";
import { el, section } from "../panels/dom";
import { isDone, listBuilds } from "./build_run";

/** A list with a build that is not done is asked for again. */
const REFRESH_MS = 4000;

export interface BuildList {
  readonly element: HTMLElement;
  /** Asks the server; what cannot be listed goes to `onProblem`. */
  refresh(): Promise<void>;
  /** Newer than what the list has of it. */
  show(build: PlanBuild): void;
}

/** The caller's builds, newest first, those that run among them. */
export function buildList(gateway: Pick<Gateway, "planBuilds">, onOpen: (build: PlanBuild) => void, onProblem: (text: string) => void): BuildList {
  const list = el("ul", { class: "cases" });
  const empty = el("p", { class: "quiet", text: "None yet." });
  let items = new Map<string, BuildItem>();
  let waiting: ReturnType<typeof setTimeout> | undefined;

  // An item stays the same element, so that the keyboard's focus stays on it.
  const itemOf = (build: PlanBuild) => items.get(build.name) ?? buildItem(onOpen);
  const showAll = (builds: readonly PlanBuild[]) => {
    const names = [...items.keys()].join();
    items = new Map(builds.map((build) => [build.name, itemOf(build)]));
    builds.forEach((build) => items.get(build.name)?.show(build));
    empty.hidden = builds.length > 0;
    if (names !== [...items.keys()].join()) list.replaceChildren(...[...items.values()].map(({ element }) => element));
  };
  const refresh = async () => {
    clearTimeout(waiting);
    let goesOn = true;
    try {
      const builds = await listBuilds(gateway);
      showAll(builds);
      goesOn = builds.some((build) => !isDone(build));
    } catch (thrown) {
      // A list that was there before is asked for again; until then it stays.
      goesOn = items.size > 0;
      if (!goesOn) onProblem(messageOf(thrown));
    }
    clearTimeout(waiting);
    if (goesOn) waiting = setTimeout(() => void refresh(), REFRESH_MS);
  };
  return {
    element: section("Builds", [list, empty]),
    refresh,
    show(build) {
      const item = items.get(build.name);
      if (item === undefined) void refresh();
      else item.show(build);
    },
  };
}

export function stateText({ state, buildsBefore, stage, isReady }: PlanBuild): string {
  switch (state) {
    case PlanBuildState.WAITING:
      return buildsBefore === 0 ? "Waiting to begin" : `Waiting: ${buildsBefore} ${buildsBefore === 1 ? "build is" : "builds are"} before this one`;
    case PlanBuildState.RUNNING:
      return stage === "" ? "Building" : `Building: ${stage}`;
    case PlanBuildState.SUCCEEDED:
      return isReady ? "The plan is ready." : "The plan misses a requirement: read the cautions.";
    case PlanBuildState.CANCELLED:
      return "The build was canceled.";
    default:
      return "The build failed.";
  }
}

interface BuildItem {
  readonly element: HTMLElement;
  show(build: PlanBuild): void;
}

function buildItem(onOpen: (build: PlanBuild) => void): BuildItem {
  let shown: PlanBuild | null = null;
  const [title, facts] = [el("strong"), el("small")];
  const control = el("button", { attributes: { type: "button" }, on: { click: () => shown !== null && onOpen(shown) } }, [title, facts]);
  return {
    element: el("li", {}, [control]),
    show(build) {
      shown = build;
      const seconds = Number(build.createTime?.seconds ?? 0n);
      title.textContent = build.title === "" ? "Untitled" : build.title;
      facts.textContent = [stateText(build), seconds === 0 ? "" : new Date(1000 * seconds).toLocaleString()].filter((fact) => fact !== "").join(" · ");
    },
  };
}
