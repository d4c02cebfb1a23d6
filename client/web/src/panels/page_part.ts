// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

/**
 * A part of the planner that is fetched when it is first used: `load` imports it. Rejects with an Error in a sentence where it
 * cannot be fetched, as after an upgrade of the server: its files have other names then.
 */
export async function pagePart<T>(load: () => Promise<T>): Promise<T> {
  try {
    return await load();
  } catch {
    throw new Error("a part of this page cannot be fetched: check the connection, then reload the page");
  }
}
