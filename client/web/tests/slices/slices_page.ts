// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import "../../src/styles/base.css";
import { SliceViews } from "../../src/slices/slice_views";

// A page with slices alone: tests/e2e/slice_views.test.ts gives them what they show, and reads what they tell.

const told: unknown[][] = [];
const views = new SliceViews({
  onCrosshair: (...values) => told.push(["crosshair", ...values]),
  onPoint: (...values) => told.push(["point", ...values]),
  onPlane: (...values) => told.push(["plane", ...values]),
});
const main = document.createElement("main");
main.style.cssText = "height: 100vh; display: grid";
const heading = document.createElement("h1");
heading.textContent = "Slices";
heading.className = "hidden";
main.append(heading, views.element);
document.body.append(main);
Object.assign(globalThis, { views, told });
