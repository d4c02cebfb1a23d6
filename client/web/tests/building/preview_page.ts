// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import "../../src/styles/base.css";
import type { Gateway } from "../../src/calls/gateway";
import { newPlanPage } from "../../src/pages/new_plan_page";

// The page of a new plan without a server, which it needs only to build: tests/e2e/piece_preview.test.ts gives it a CT.

const noServer = new Proxy({}, { get: () => new Proxy({}, { get: () => () => Promise.reject(new Error("there is no server")) }) }) as Gateway;
const { element, draft } = newPlanPage(noServer, null, () => {}, () => {}, null);
document.body.append(element);
Object.assign(globalThis, { draft });
