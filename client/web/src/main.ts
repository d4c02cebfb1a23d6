// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import "./styles/base.css";
import "./styles/start.css";
import "./styles/planner.css";
import "./styles/panel.css";
import "./styles/report.css";
import { fetchDraft } from "./building/build_drafts";
import { Bearer } from "./calls/bearer";
import { Code, messageOf, toCallError } from "./calls/call_error";
import { Gateway, baseOf } from "./calls/gateway";
import { type CaseFile, openCase } from "./case/case_file";
import { serverSource } from "./case/case_sources";
import { type ContactChoice, contactChoiceOf, contactSuffix, sealedCase, toContactChoice } from "./case/contact_choice";
import type { ModelInfo } from "./generated/tissueform/v1/server_info_pb";
import { isLinkToken } from "./live/follow_links";
import type { Login } from "./login/login";
import { fetchLoginConfig } from "./login/login_config";
import { casesPage } from "./pages/cases_page";
import { LINK_HAS_ENDED, followerPage } from "./pages/follower_page";
import { pagePart } from "./panels/page_part";
import { plannerPage } from "./pages/planner_page";
import { signInPage } from "./pages/sign_in_page";
import { accountBox, loginBanner } from "./panels/account_box";
import { button, el } from "./panels/dom";
import { formatProgress } from "./planning/numbers";
import { carryWork, restoreWork, takeCarriedWork, workOf } from "./workbench/work";
import type { Workbench } from "./workbench/workbench";

// The part after the # says which page this is:
//
//   nothing                            the list of cases
//   #case={sha256}                     the planner of a case
//   #case={sha256}&contact=off         the same, where tissue sticks and lips are one piece; so with followers
//   #case={sha256}&contact=sealed      the same, where closed lips stay closed
//   #new                               a new plan from a CT
//   #new&draft={id}                    the same, of a CT that waits on the server
//   #follow={session}&case={sha256}    read-only, follows another user's plan; where the server has logins, the link's token
//                                      takes the session's place, and followers need not sign in

/** For tests and measurements: what the page holds now. Nothing of the page asks it. */
interface TestHook {
  bench?: Workbench;
  follower?: unknown;
  view?: unknown;
  /** What reads a CT. */
  volume: () => Promise<typeof import("./volume/opened_ct")>;
  draft?: unknown;
}

/** The page's own path: a proxy may have it below one of its own. */
const base = baseOf(location.href);
const gateway = new Gateway(base, new Bearer());
/** Null where the server has no logins. */
let login: Login | null = null;
let banner: HTMLElement | null = null;
const hook: TestHook = { volume: () => pagePart(() => import("./volume/opened_ct")) };
(globalThis as unknown as { tissueform: TestHook }).tissueform = hook;

async function start(): Promise<void> {
  try {
    if (isLinkToken(parameters().follow)) gateway.bearer.token = parameters().follow;
    else if (!(await signIn())) return;
    await route();
  } catch (thrown) {
    showProblem("The planner cannot be opened", thrown, [button("Try again", () => location.reload())]);
  }
}

/** True when the pages may be shown; else the user is on their way to the provider, or is asked to sign in. */
async function signIn(): Promise<boolean> {
  const config = await fetchLoginConfig(base);
  if (config === null) return true;
  const { oidcLogin } = await pagePart(() => import("./login/oidc_login"));
  const user = oidcLogin(config, gateway.bearer);
  login = user;
  banner = loginBanner(user, () => (hook.bench === undefined ? null : workOf(hook.bench)));
  user.watch((state) => {
    if (state.kind === "asking") show(waitingPage("Signing in"));
    if (state.kind === "out") show(signInPage(user, state.problem));
  });
  await user.begin();
  return user.state.kind === "in";
}

function parameters(): { caseId: string; follow: string; contact: ContactChoice; isNew: boolean; draftId: string } {
  const all = new URLSearchParams(location.hash.slice(1));
  return { caseId: all.get("case") ?? "", follow: all.get("follow") ?? "", contact: toContactChoice(all.get("contact")), isNew: all.has("new"), draftId: all.get("draft") ?? "" };
}

async function route(): Promise<void> {
  const { caseId, follow, isNew, draftId } = parameters();
  if (isNew) return openNewPlan(draftId);
  if (!/^[0-9a-f]{64}$/.test(caseId)) {
    show(casesPage(gateway, (entry) => go(entry.name.replace("cases/", "")), (draft) => (location.hash = draft === null ? "new" : `new&draft=${draft.name.replace("buildDrafts/", "")}`), account()));
    return;
  }
  const name = `cases/${caseId}`;
  try {
    if (isLinkToken(follow)) await openLink(name);
    else if (follow !== "") openFollower(await fetchCase(name), `sessions/${follow}`, null);
    else await openPlanner(name);
  } catch (thrown) {
    const buttons = [button("Try again", () => void route()), button("Cases", () => (location.hash = ""))];
    showProblem("The case cannot be opened", thrown, buttons);
  }
}

async function openNewPlan(draftId: string): Promise<void> {
  try {
    const received = draftId === "" ? null : await fetchDraft(gateway, `buildDrafts/${draftId}`);
    const { newPlanPage } = await pagePart(() => import("./pages/new_plan_page"));
    const { element, draft } = newPlanPage(gateway, received, (name) => go(name.replace("cases/", "")), () => (location.hash = ""), account());
    hook.draft = draft;
    show(element);
  } catch (thrown) {
    showProblem("A new plan cannot be begun", thrown, [button("Try again", () => void route()), button("Cases", () => (location.hash = ""))]);
  }
}

function account(): HTMLElement | null {
  return login === null ? null : accountBox(login);
}

function go(caseId: string): void {
  location.hash = `case=${caseId}`;
}

async function openPlanner(name: string): Promise<void> {
  const [file, models, hasLogins] = await Promise.all([fetchCase(name), fetchModels(), knowsCallers()]);
  const caseId = name.replace("cases/", "");
  const addressed = (choice: ContactChoice) => (choice === "on" ? "" : `&${contactSuffix(choice)}`);
  const followUrl = (follow: string) => `${base}/#follow=${follow}&case=${caseId}${addressed(contactChoiceOf(file))}`;
  const chooseContact = async (choice: ContactChoice) => {
    carryWork(bench);
    await bench.live.end();
    location.hash = `case=${caseId}${addressed(choice)}`;
  };
  const parts = { followUrl, hasLogins, account: account(), chooseContact };
  const { element, bench } = plannerPage(gateway, file, name, models, parts, () => (location.hash = ""));
  hook.bench = bench;
  hook.view = bench.view;
  show(element);
  await bench.start();
  if (login !== null) restoreWork(bench, login.work);
  restoreWork(bench, takeCarriedWork());
}

function openFollower(file: CaseFile, session: string, endsAt: Date | null): void {
  const { element, follower } = followerPage(gateway, file, session, { endsAt, account: account() });
  hook.follower = follower;
  hook.view = follower.view;
  show(element);
}

/** The token says which session it is for. */
async function openLink(name: string): Promise<void> {
  try {
    const { onlySession, expireTime } = await gateway.access.whoAmI({});
    openFollower(await fetchCase(name), onlySession, expireTime === undefined ? null : new Date(1000 * Number(expireTime.seconds)));
  } catch (thrown) {
    if (toCallError(thrown).code !== Code.Unauthenticated) throw thrown;
    showProblem("Nothing to follow", LINK_HAS_ENDED, []);
  }
}

/** Whether the server asks who calls; one that does not may be older than the question. */
async function knowsCallers(): Promise<boolean> {
  if (login === null) return false;
  try {
    return (await gateway.access.whoAmI({})).principal !== "";
  } catch (thrown) {
    const error = toCallError(thrown);
    if (error.code === Code.Unimplemented) return false;
    throw error;
  }
}

async function fetchCase(name: string): Promise<CaseFile> {
  const bar = el("progress", { attributes: { max: "1", "aria-label": "Progress" } });
  const status = el("p", { class: "told", text: "Asking the server" });
  show(waitingPage("Opening the case", bar, status));
  const entry = await gateway.cases.getCase({ name }).catch((thrown) => Promise.reject(toCallError(thrown)));
  const onProgress = (done: number, total: number) => {
    bar.value = done / total;
    status.textContent = formatProgress(done, total);
  };
  const file = await openCase(serverSource(gateway, entry), onProgress);
  return withContact(file, parameters().contact);
}

/** One that has no contact sticks anyway. */
async function withContact(file: CaseFile, choice: ContactChoice): Promise<CaseFile> {
  if (choice === "sealed") return sealedCase(file);
  if (choice === "on" || file.sessionRequest.contact.length === 0) return file;
  const { stickingCase } = await pagePart(() => import("./case/sticking_case"));
  return stickingCase(file);
}

async function fetchModels(): Promise<readonly ModelInfo[]> {
  try {
    return (await gateway.serverInfo.getServerInfo({})).models;
  } catch (thrown) {
    throw toCallError(thrown);
  }
}

function waitingPage(title: string, ...below: HTMLElement[]): HTMLElement {
  return el("main", { class: "start" }, [el("div", { class: "sheet" }, [el("h1", { text: title }), ...below])]);
}

function showProblem(title: string, thrown: unknown, buttons: HTMLElement[]): void {
  const text = messageOf(thrown);
  const sheet = [
    el("h1", { text: title }),
    el("p", { class: "problem", text, attributes: { role: "alert" } }),
    el("div", { class: "buttons" }, buttons),
  ];
  show(el("main", { class: "start" }, [el("div", { class: "sheet" }, sheet)]));
}

function show(element: HTMLElement): void {
  document.body.replaceChildren(element, ...(banner === null ? [] : [banner]));
}

// A page of its own for each case: what belonged to the one before is gone with it.
addEventListener("hashchange", () => location.reload());
void start();
