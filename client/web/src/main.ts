// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import "./styles/base.css";
import "./styles/start.css";
import "./styles/planner.css";
import "./styles/panel.css";
import { sentenceOf, toCallError } from "./calls/call_error";
import { Gateway } from "./calls/gateway";
import { type CaseFile, openCase } from "./case/case_file";
import { serverSource } from "./case/case_sources";
import type { ModelInfo } from "./generated/tissueform/v1/server_info_pb";
import { casesPage } from "./pages/cases_page";
import { followerPage } from "./pages/follower_page";
import { plannerPage } from "./pages/planner_page";
import { button, el } from "./panels/dom";

// What stands behind the # says which page this is:
//
//   nothing                            the list of cases
//   #case={sha256}                     the planner of a case
//   #follow={session}&case={sha256}    read-only, beside somebody who plans

/** For tests and measurements: what the page holds now. Nothing of the page asks it. */
interface TestHook {
  bench?: unknown;
  follower?: unknown;
  view?: unknown;
}

const gateway = new Gateway(location.origin);
const hook: TestHook = {};
(globalThis as unknown as { tissueform: TestHook }).tissueform = hook;

async function route(): Promise<void> {
  const parameters = new URLSearchParams(location.hash.slice(1));
  const caseId = parameters.get("case") ?? "";
  const follow = parameters.get("follow");
  if (!/^[0-9a-f]{64}$/.test(caseId)) {
    show(casesPage(gateway, (entry) => go(entry.name.replace("cases/", ""))));
    return;
  }
  try {
    const name = `cases/${caseId}`;
    const [file, models] = await Promise.all([fetchCase(name), fetchModels()]);
    if (follow !== null) openFollower(file, `sessions/${follow}`);
    else await openPlanner(file, name, models);
  } catch (thrown) {
    showProblem(sentenceOf(thrown));
  }
}

function go(caseId: string): void {
  location.hash = `case=${caseId}`;
}

async function openPlanner(file: CaseFile, name: string, models: readonly ModelInfo[]): Promise<void> {
  const link = (session: string) => `${location.origin}${location.pathname}#follow=${session.replace("sessions/", "")}&case=${name.replace("cases/", "")}`;
  const { element, bench } = plannerPage(gateway, file, name, models, link, () => (location.hash = ""));
  hook.bench = bench;
  hook.view = bench.view;
  show(element);
  await bench.start();
}

function openFollower(file: CaseFile, session: string): void {
  const { element, follower } = followerPage(gateway, file, session);
  hook.follower = follower;
  hook.view = follower.view;
  show(element);
}

async function fetchCase(name: string): Promise<CaseFile> {
  const bar = el("progress", { attributes: { max: "1", value: "0", "aria-label": "Progress" } });
  show(el("main", { class: "start" }, [el("div", { class: "sheet" }, [el("h1", { text: "Opening the case" }), bar])]));
  const entry = await gateway.cases.getCase({ name }).catch((thrown) => Promise.reject(toCallError(thrown)));
  return openCase(serverSource(gateway, entry), (share) => (bar.value = share));
}

async function fetchModels(): Promise<readonly ModelInfo[]> {
  try {
    return (await gateway.serverInfo.getServerInfo({})).models;
  } catch (thrown) {
    throw toCallError(thrown);
  }
}

function showProblem(text: string): void {
  const sheet = [
    el("h1", { text: "The case cannot be opened" }),
    el("p", { class: "problem", text, attributes: { role: "alert" } }),
    el("div", { class: "buttons" }, [button("Try again", () => void route()), button("Cases", () => (location.hash = ""))]),
  ];
  show(el("main", { class: "start" }, [el("div", { class: "sheet" }, sheet)]));
}

function show(element: HTMLElement): void {
  document.body.replaceChildren(element);
}

// A page of its own for each case: what belonged to the one before is gone with it.
addEventListener("hashchange", () => location.reload());
void route();
