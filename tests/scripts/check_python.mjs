#!/usr/bin/env node
// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// Checks client/python, client/slicer and their tests with ruff, whose WebAssembly deploy/install_protocol_tools.sh installs from npm:
// Debian 12 has no ruff.
//
//   tests/scripts/check_python.mjs    exit code 1 where ruff finds something

import {execFileSync} from "node:child_process";
import {readFileSync} from "node:fs";
import {createRequire} from "node:module";

const ROOT = new URL("../../", import.meta.url);
const FOLDERS = ["client/python", "client/slicer", "tests/client/python", "tests/client/slicer"];
// Errors, unused and undefined names, blanks, and likely defects. B008: frozen defaults such as Prepared() are on purpose.
const SETTINGS = {"line-length": 160, "target-version": "py39", lint: {select: ["E", "F", "W", "B"], ignore: ["B008"]}};

const {Workspace, PositionEncoding} = createRequire(new URL("deploy/protocol_tools/package.json", ROOT))("@astral-sh/ruff-wasm-nodejs");
const workspace = new Workspace(SETTINGS, PositionEncoding.Utf16);
const listed = execFileSync("git", ["ls-files", "-z", "--cached", "--others", "--exclude-standard", "--", ...FOLDERS], {cwd: ROOT, encoding: "utf8"});
const files = listed.split("\0").filter((name) => name.endsWith(".py"));
let found = 0;
for (const name of files) {
  for (const {code, message, start_location: place} of workspace.check(readFileSync(new URL(name, ROOT), "utf8"))) {
    console.error(`${name}:${place.row}: ${code ?? "syntax"} ${message}`);
    ++found;
  }
}
process.exit(files.length > 0 && found === 0 ? 0 : 1);
