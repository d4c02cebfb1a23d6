// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import "../../src/styles/base.css";
import { SliceViews } from "../../src/slices/slice_views";

// A page with slices alone: tests/e2e/slice_views.test.ts gives them what they show, and reads what they report.

const reported: unknown[][] = [];
const views = new SliceViews({
  onCrosshair: (...values) => reported.push(["crosshair", ...values]),
  onPoint: (...values) => reported.push(["point", ...values]),
  onPlane: (...values) => reported.push(["plane", ...values]),
});
const main = document.createElement("main");
main.style.cssText = "height: 100vh; display: grid";
const heading = document.createElement("h1");
heading.textContent = "Slices";
heading.className = "hidden";
main.append(heading, views.element);
document.body.append(main);
Object.assign(globalThis, { views, reported });
