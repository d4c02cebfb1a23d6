// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { type Timer, browserTimer } from "../calls/backoff";
import { Code, toCallError } from "../calls/call_error";
import type { Gateway } from "../calls/gateway";
import { steady } from "../calls/steady";
import type { Case } from "../generated/tissueform/v1/case_pb";
import type { CaseSource } from "./case_file";
import { subtleCrypto } from "./secure_page";

const PAGE_SIZE = 200;

/** A file of this computer. */
export function fileSource(file: Blob): CaseSource {
  return {
    totalBytes: file.size,
    async read(offset, length, onBytes) {
      const bytes = new Uint8Array(await file.slice(offset, offset + length).arrayBuffer());
      if (bytes.length !== length) throw new Error("the file became shorter: drop it again");
      onBytes?.(length);
      return bytes;
    },
  };
}

/** How often a download goes on that breaks off without having brought anything. */
const MOST_TRIES = 3;

/** A case that a server keeps. A download that breaks off, or stands still, goes on where it was. */
export function serverSource(gateway: { cases: Pick<Gateway["cases"], "readCase"> }, entry: Pick<Case, "name" | "totalBytes">, timer: Timer = browserTimer): CaseSource {
  return {
    totalBytes: Number(entry.totalBytes),
    async read(offset, length, onBytes) {
      const bytes = new Uint8Array(length);
      let done = 0;
      for (let tries = 0; done < length; ) {
        const before = done;
        try {
          const request = { name: entry.name, readOffset: BigInt(offset + done), readLimit: BigInt(length - done) };
          for await (const { data } of steady((signal) => gateway.cases.readCase(request, { timeoutMs: 0, signal }), { timer })) {
            if (done + data.length > length) throw new Error("the server sent more of the case than requested");
            bytes.set(data, done);
            done += data.length;
            onBytes?.(done);
          }
          if (done < length) throw new Error("the server sent less of the case than requested");
        } catch (thrown) {
          const error = toCallError(thrown);
          tries = done > before ? 0 : tries + 1;
          if (tries > MOST_TRIES || error.code !== Code.Unavailable) throw error;
        }
      }
      return bytes;
    },
  };
}

/** All cases of the server. Rejects with a CallError. */
export async function listCases(gateway: Gateway): Promise<Case[]> {
  const cases: Case[] = [];
  let pageToken = "";
  try {
    do {
      const page = await gateway.cases.listCases({ pageSize: PAGE_SIZE, pageToken });
      cases.push(...page.cases);
      pageToken = page.nextPageToken;
    } while (pageToken !== "");
  } catch (thrown) {
    throw toCallError(thrown);
  }
  return cases;
}

/** In hexadecimal digits. Rejects with an Error on pages where browsers check no files. */
export async function sha256Of(file: Blob): Promise<string> {
  const digest = await subtleCrypto("checks files", "or publish the case with tissueform case publish").digest("SHA-256", await file.arrayBuffer());
  return Array.from(new Uint8Array(digest), (byte) => byte.toString(16).padStart(2, "0")).join("");
}
