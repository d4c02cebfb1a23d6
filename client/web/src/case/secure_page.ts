// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

/**
 * What browsers digest and encrypt with, on pages of https and of this computer only. Elsewhere it throws an Error with a sentence:
 * `what` the browser does there alone ("checks files"), and what else there is (`otherwise`, "or print the report").
 */
export function subtleCrypto(what: string, otherwise = ""): SubtleCrypto {
  if (globalThis.crypto?.subtle === undefined) {
    throw new Error(`this browser ${what} on https pages only: open the planner by https${otherwise === "" ? "" : `, ${otherwise}`}`);
  }
  return crypto.subtle;
}
