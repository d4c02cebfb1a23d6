// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { readFileSync } from "node:fs";

// In a browser the evaluator comes from the gateway; here it lies beside the sources, and Node fetches no files.

const fetchByNetwork = globalThis.fetch;
globalThis.fetch = async (input, init) =>
  input instanceof URL && input.protocol === "file:" ? new Response(readFileSync(input)) : fetchByNetwork(input, init);
