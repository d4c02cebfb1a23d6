// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// Fails when the built planner is larger, gzipped, than a slow network takes in a second or so, or a part that is fetched when it
// is first used, or the page of files that move, which is fetched when one is made.

import { readFileSync, readdirSync } from "node:fs";
import { gzipSync } from "node:zlib";

const MOST_BYTES = 300 * 1024;
const APART = { "moving-file.html": 250 * 1024 };
/** Names of the parts, up to the hash. */
const LATE = /^(moving_export|oidc_login|report_file|report_sheet)-/;
const MOST_LATE_BYTES = 16 * 1024;
const folder = new URL("../../build/web/", import.meta.url);

let total = 0;
let isTooLarge = false;
for (const entry of readdirSync(folder, { recursive: true, withFileTypes: true })) {
  if (!entry.isFile()) continue;
  const path = `${entry.parentPath ?? entry.path}/${entry.name}`;
  const bytes = gzipSync(readFileSync(path), { level: 9 }).length;
  if (entry.name in APART) isTooLarge ||= bytes > APART[entry.name];
  else if (LATE.test(entry.name)) isTooLarge ||= bytes > MOST_LATE_BYTES;
  else total += bytes;
  console.log(`${String(bytes).padStart(8)}  ${entry.name}`);
}
console.log(`${String(total).padStart(8)}  at the start; at most ${MOST_BYTES}`);
process.exit(total <= MOST_BYTES && !isTooLarge ? 0 : 1);
