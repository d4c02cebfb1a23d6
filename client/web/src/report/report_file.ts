// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { subtleCrypto } from "../case/secure_page";
import { NOTICE } from "../exports/files";
import style from "../styles/report.css?inline";

/** The sheet as a file of its own: one style by its hash, pictures within, no script, and nothing that it may load. Rejects with an Error where the browser has no hash. */
export async function reportFile(sheet: HTMLElement): Promise<string> {
  const digest = await subtleCrypto("writes the report as a file", "or print the report").digest("SHA-256", new TextEncoder().encode(style));
  const hash = btoa(String.fromCharCode(...new Uint8Array(digest)));
  const policy = `default-src 'none'; style-src 'sha256-${hash}'; img-src data:; base-uri 'none'; form-action 'none'`;
  return [
    "<!doctype html>",
    `<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1"><meta http-equiv="Content-Security-Policy" content="${policy}">`,
    `<title>Tissueform report, ${NOTICE}</title><style>${style}</style></head>`,
    `<body>${sheet.outerHTML}</body></html>`,
    "",
  ].join("\n");
}
