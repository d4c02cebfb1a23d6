// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// Fails when the built planner is larger, gzipped, than a slow network takes in a second or so, or a part that is fetched when it
// is first used, or the page of files that move, which is fetched when one is made.

import { readFileSync, readdirSync } from "node:fs";
import { gzipSync } from "node:zlib";

const MOST_BYTES = 300 * 1024;
const APART = { "moving-file.html": 250 * 1024 };
const KIB = 1024;
/** Parts that are fetched when they are first used, by their names up to the hash, and how large each may be. */
const PARTS = {
  bone_worker: 16 * KIB,
  case_plan: 16 * KIB,
  charlswasm_decode: 64 * KIB,
  contact_areas: 4 * KIB,
  deviations: 2 * KIB,
  movement_bands: 4 * KIB,
  moving_export: 16 * KIB,
  new_plan_page: 28 * KIB,
  oidc_login: 16 * KIB,
  opened_ct: 4 * KIB,
  openjpegwasm_decode: 128 * KIB,
  operation_choice: KIB,
  photograph_part: 16 * KIB,
  photograph_worker: 120 * KIB,
  plan_export: 16 * KIB,
  planner_slices: 16 * KIB,
  report_file: 16 * KIB,
  report_sheet: 16 * KIB,
  resting_band: KIB,
  side_by_side_page: 16 * KIB,
  skin_points: 2 * KIB,
  slice_views: 16 * KIB,
  sticking_case: 4 * KIB,
  touch_part: 2 * KIB,
  volume_worker: 80 * KIB,
  whole_band: 16 * KIB,
};
const partOf = (name) => Object.keys(PARTS).find((part) => name.startsWith(`${part}-`));
const folder = new URL("../../build/web/", import.meta.url);

let total = 0;
let isTooLarge = false;
for (const entry of readdirSync(folder, { recursive: true, withFileTypes: true })) {
  if (!entry.isFile()) continue;
  const path = `${entry.parentPath ?? entry.path}/${entry.name}`;
  const bytes = gzipSync(readFileSync(path), { level: 9 }).length;
  if (entry.name in APART) isTooLarge ||= bytes > APART[entry.name];
  else if (partOf(entry.name)) isTooLarge ||= bytes > PARTS[partOf(entry.name)];
  else total += bytes;
  console.log(`${String(bytes).padStart(8)}  ${entry.name}`);
}
console.log(`${String(total).padStart(8)}  at the start; at most ${MOST_BYTES}`);
process.exit(total <= MOST_BYTES && !isTooLarge ? 0 : 1);
