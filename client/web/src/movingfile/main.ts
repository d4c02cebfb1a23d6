// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import "../styles/base.css";
import "../styles/planner.css";
import "../styles/panel.css";
import "../styles/moving.css";
import { DamagedError, type Envelope, type Sealed, WrongPasswordError, checkWhole, fromBase64, unseal } from "../movingdata/sealed_payload";
import { readMovingData } from "../movingdata/moving_data";
import { NoEvaluatorError } from "../evaluation/evaluator_module";
import { el } from "../panels/dom";
import { startEngine } from "./engine";
import type { MovingHead } from "./moving_head";
import { movingPage } from "./moving_page";

// The script of a file that moves. It stands before the data in the page, so that it can say when they are cut off.

const DAMAGED = "This file is damaged or incomplete. Ask its sender for a new copy.";
const NO_EVALUATOR = "This browser cannot calculate in this file: it needs WebAssembly, which this browser is too old for or has switched off (Lockdown Mode). Open the file in a current Firefox, Chromium, Chrome, Edge or Safari.";
const TOO_OLD = "This browser is too old for this file: open it in a current Firefox, Chromium, Chrome, Edge or Safari.";

/** For tests: the head. Nothing of the page asks it. */
const hook: { moving?: MovingHead } = {};
(globalThis as unknown as { tissueform: typeof hook }).tissueform = hook;

async function start(): Promise<void> {
  try {
    if (globalThis.crypto?.subtle === undefined || typeof DecompressionStream === "undefined") return say(TOO_OLD);
    const sealed = readDocument();
    await checkWhole(sealed);
    if (sealed.envelope.encryption === undefined) await open(sealed, "");
    else askPassword(sealed);
  } catch (thrown) {
    console.error(thrown);
    say(problemOf(thrown));
  }
}

function problemOf(thrown: unknown): string {
  return thrown instanceof NoEvaluatorError ? NO_EVALUATOR : DAMAGED;
}

function readDocument(): Sealed {
  const text = (id: string) => document.getElementById(id)?.textContent ?? "";
  let envelope: Envelope;
  try {
    envelope = JSON.parse(text("envelope")) as Envelope;
  } catch {
    throw new DamagedError();
  }
  return { envelope, payload: fromBase64(text("payload")) };
}

async function open(sealed: Sealed, password: string): Promise<void> {
  const data = readMovingData(await unseal(sealed, password));
  const { element, head } = await movingPage(data, await startEngine(data.answers));
  if (data.title !== "") document.title = data.title;
  show(element);
  hook.moving = head;
}

function askPassword(sealed: Sealed): void {
  const input = el("input", { id: "password", attributes: { type: "password", autocomplete: "off", required: "" } });
  const problem = el("p", { class: "problem", attributes: { role: "alert" } });
  const submit = el("button", { text: "Open", attributes: { type: "submit" } });
  const form = el("form", { class: "sheet" }, [
    el("label", { text: "This file is locked. Its password:", attributes: { for: "password" } }),
    input,
    submit,
    problem,
  ]);
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    submit.disabled = true;
    problem.textContent = "";
    open(sealed, input.value)
      .catch((thrown) => {
        const isWrong = thrown instanceof WrongPasswordError;
        problem.textContent = isWrong ? "This is not the password of this file." : problemOf(thrown);
        if (!isWrong) console.error(thrown);
        input.select();
      })
      .finally(() => (submit.disabled = false));
  });
  show(el("div", { class: "start" }, [form]));
  input.focus();
}

function say(text: string): void {
  show(el("div", { class: "start" }, [el("p", { class: "sheet problem", text, attributes: { role: "alert" } })]));
}

function show(element: HTMLElement): void {
  document.getElementById("page")?.replaceChildren(element);
}

// The data stand behind this script.
if (document.readyState === "loading") addEventListener("DOMContentLoaded", () => void start());
else void start();
