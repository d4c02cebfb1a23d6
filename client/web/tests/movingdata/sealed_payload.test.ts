// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { gunzipSync } from "node:zlib";
import { describe, expect, test } from "vitest";
import { fillTemplate } from "../../src/movingdata/page_template";
import { DamagedError, KEY_ROUNDS, WrongPasswordError, checkWhole, fromBase64, seal, toBase64, unseal } from "../../src/movingdata/sealed_payload";

const DATA = new TextEncoder().encode("a face, a face, a face and a chin") as Uint8Array<ArrayBuffer>;
const PASSWORD = "correct horse bättery";

describe("a payload", () => {
  test("without a password is gzip, and comes back", async () => {
    const sealed = await seal(DATA, "");
    expect(sealed.envelope.encryption).toBe(undefined);
    expect(new Uint8Array(gunzipSync(sealed.payload))).toEqual(DATA);
    await checkWhole(sealed);
    expect(await unseal(sealed, "")).toEqual(DATA);
  });

  test("with a password opens by that one only", async () => {
    const sealed = await seal(DATA, PASSWORD);
    expect(sealed.envelope.encryption).toMatchObject({ cipher: "AES-256-GCM", derivation: "PBKDF2-SHA-256", rounds: KEY_ROUNDS });
    expect(KEY_ROUNDS).toBeGreaterThanOrEqual(600_000);
    await checkWhole(sealed);
    expect(await unseal(sealed, PASSWORD)).toEqual(DATA);
    await expect(unseal(sealed, "correct horse battery")).rejects.toBeInstanceOf(WrongPasswordError);
  });

  test("opens by its password however that is written", async () => {
    const [composed, decomposed] = [PASSWORD.normalize("NFC"), PASSWORD.normalize("NFD")];
    expect(decomposed).not.toBe(composed);
    const sealed = await seal(DATA, decomposed);
    expect(await unseal(sealed, composed)).toEqual(DATA);
    expect(await unseal(sealed, decomposed)).toEqual(DATA);
  });

  test("that the command has sealed by a decomposed password opens by either", async () => {
    const [salt, iv] = [new Uint8Array(16), new Uint8Array(12)];
    const rounds = 1000;
    const secret = await crypto.subtle.importKey("raw", new TextEncoder().encode(PASSWORD.normalize("NFD")), "PBKDF2", false, ["deriveKey"]);
    const key = await crypto.subtle.deriveKey({ name: "PBKDF2", hash: "SHA-256", salt, iterations: rounds }, secret, { name: "AES-GCM", length: 256 }, false, ["encrypt"]);
    const { envelope, payload } = await seal(DATA, "");
    const encryption = { cipher: "AES-256-GCM", derivation: "PBKDF2-SHA-256", rounds, salt: toBase64(salt), nonce: toBase64(iv) } as const;
    const sealed = { envelope: { ...envelope, encryption }, payload: new Uint8Array(await crypto.subtle.encrypt({ name: "AES-GCM", iv }, key, payload)) };
    for (const form of ["NFC", "NFD"]) expect(await unseal(sealed, PASSWORD.normalize(form))).toEqual(DATA);
    await expect(unseal(sealed, "correct horse battery")).rejects.toBeInstanceOf(WrongPasswordError);
  });

  test("that was changed, or is cut off, is damaged", async () => {
    const sealed = await seal(DATA, "");
    const changed = sealed.payload.slice();
    changed[12] ^= 1;
    await expect(checkWhole({ ...sealed, payload: changed })).rejects.toBeInstanceOf(DamagedError);
    await expect(checkWhole({ ...sealed, payload: sealed.payload.slice(0, 20) })).rejects.toBeInstanceOf(DamagedError);
    await expect(unseal({ ...sealed, payload: sealed.payload.slice(0, 20) }, "")).rejects.toBeInstanceOf(DamagedError);
  });

  test("whose envelope asks for rounds without end is damaged", async () => {
    const sealed = await seal(DATA, PASSWORD);
    const encryption = { ...sealed.envelope.encryption!, rounds: 1e12 };
    await expect(unseal({ ...sealed, envelope: { ...sealed.envelope, encryption } }, PASSWORD)).rejects.toBeInstanceOf(DamagedError);
  });
});

test("base64 is that of everybody, of any length", () => {
  for (const length of [0, 1, 2, 3, 0x6000 - 1, 0x6000, 0x6001, 100_000]) {
    const bytes = Uint8Array.from({ length }, (_, i) => (i * 37) & 255);
    expect(toBase64(bytes)).toBe(Buffer.from(bytes).toString("base64"));
    expect(fromBase64(toBase64(bytes))).toEqual(bytes);
  }
  expect(() => fromBase64("no base64!")).toThrow(DamagedError);
});

test("a page without its marks is refused", async () => {
  const sealed = await seal(DATA, "");
  const page = fillTemplate("<a>@TISSUEFORM-ENVELOPE@</a><b>@TISSUEFORM-PAYLOAD@</b>", sealed);
  expect(page).toBe(`<a>${JSON.stringify(sealed.envelope)}</a><b>${toBase64(sealed.payload)}</b>`);
  expect(() => fillTemplate("<html></html>", sealed)).toThrow("another version");
});
