// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// What Khronos' validator says of a binary glTF file: node validate_gltf.js NODE_MODULES FILE. Ends with 1 on an error
// or a warning, which it prints.
"use strict";

const fs = require("fs");
const path = require("path");
const [modules, file] = process.argv.slice(2);
const validator = require(path.join(modules, "gltf-validator"));

validator.validateBytes(new Uint8Array(fs.readFileSync(file)), { format: "glb" }).then((report) => {
  const found = report.issues.messages.filter((issue) => issue.severity < 2);
  for (const issue of found) console.log(`${issue.code} ${issue.pointer}: ${issue.message}`);
  process.exitCode = found.length > 0 ? 1 : 0;
});
