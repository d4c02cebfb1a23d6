// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type Sealed, toBase64 } from "./sealed_payload";

/** Beside the planner's index.html: the page with these marks, each once, where envelope and payload belong. */
export const TEMPLATE_FILE = "moving-file.html";
const ENVELOPE_MARK = "@TISSUEFORM-ENVELOPE@";
const PAYLOAD_MARK = "@TISSUEFORM-PAYLOAD@";

/** The file that moves. Throws an Error if `template` is not the page's template. */
export function fillTemplate(template: string, { envelope, payload }: Sealed): string {
  const [head, between, tail] = splitAt(template, [ENVELOPE_MARK, PAYLOAD_MARK]);
  return [head, JSON.stringify(envelope), between, toBase64(payload), tail].join("");
}

function splitAt(template: string, marks: string[]): string[] {
  const parts: string[] = [];
  let rest = template;
  for (const mark of marks) {
    const pieces = rest.split(mark);
    if (pieces.length !== 2) throw new Error("the page of moving files has another version than the planner: build or install them together");
    parts.push(pieces[0]);
    rest = pieces[1];
  }
  return [...parts, rest];
}
