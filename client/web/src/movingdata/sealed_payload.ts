// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { subtleCrypto } from "../case/secure_page";

// The bytes of a file that moves: compressed, and under a password encrypted. docs/moving-file.md; tissueform export does the same.

/** What stands before the payload, for all to read. */
export interface Envelope {
  format: "tissueform-moving-file";
  version: 1;
  /** Of the payload, as it stands in the file. */
  bytes: number;
  sha256: string;
  encryption?: { cipher: "AES-256-GCM"; derivation: "PBKDF2-SHA-256"; rounds: number; salt: string; nonce: string };
}

export interface Sealed {
  envelope: Envelope;
  payload: Uint8Array<ArrayBuffer>;
}

/** Cut off, or changed on its way. */
export class DamagedError extends Error {}
export class WrongPasswordError extends Error {}

export const KEY_ROUNDS = 600_000;
const MOST_ROUNDS = 10_000_000;
const SALT_BYTES = 16;
const NONCE_BYTES = 12;
/** Before they are compressed: a few bytes could become more than a browser has. */
const MOST_DATA_BYTES = 256 << 20;

/** Without a password: only compressed. Rejects with an Error where there is more than a page takes, and where the browser has no hash. */
export async function seal(data: Uint8Array<ArrayBuffer>, password: string): Promise<Sealed> {
  if (data.length > MOST_DATA_BYTES) throw new Error(`the moving file would have ${data.length} bytes; the limit is ${MOST_DATA_BYTES}`);
  const subtle = subtleCrypto("writes moving files");
  const packed = await collect(new Blob([data]).stream().pipeThrough(new CompressionStream("gzip")));
  if (password === "") return { envelope: await envelopeOf(packed), payload: packed };
  const salt = crypto.getRandomValues(new Uint8Array(SALT_BYTES));
  const nonce = crypto.getRandomValues(new Uint8Array(NONCE_BYTES));
  const key = await keyOf(password.normalize("NFC"), salt, KEY_ROUNDS);
  const payload = new Uint8Array(await subtle.encrypt({ name: "AES-GCM", iv: nonce }, key, packed));
  const encryption = { cipher: "AES-256-GCM", derivation: "PBKDF2-SHA-256", rounds: KEY_ROUNDS, salt: toBase64(salt), nonce: toBase64(nonce) } as const;
  return { envelope: { ...(await envelopeOf(payload)), encryption }, payload };
}

async function envelopeOf(payload: Uint8Array<ArrayBuffer>): Promise<Envelope> {
  return { format: "tissueform-moving-file", version: 1, bytes: payload.length, sha256: await sha256(payload) };
}

/** Throws a DamagedError unless they are the bytes that the envelope says. */
export async function checkWhole({ envelope, payload }: Sealed): Promise<void> {
  if (payload.length !== envelope.bytes || (await sha256(payload)) !== envelope.sha256) throw new DamagedError();
}

/** The data of a payload that is whole. `password`: "" without one. Throws a WrongPasswordError or a DamagedError. */
export async function unseal({ envelope, payload }: Sealed, password: string): Promise<Uint8Array<ArrayBuffer>> {
  const packed = envelope.encryption === undefined ? payload : await decrypt(envelope.encryption, payload, password);
  try {
    return await collect(new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip")));
  } catch {
    throw new DamagedError();
  }
}

async function decrypt({ rounds, salt, nonce }: NonNullable<Envelope["encryption"]>, payload: Uint8Array<ArrayBuffer>, password: string): Promise<Uint8Array<ArrayBuffer>> {
  if (!Number.isSafeInteger(rounds) || rounds < 1 || rounds > MOST_ROUNDS) throw new DamagedError();
  for (const way of waysToWrite(password)) {
    const key = await keyOf(way, fromBase64(salt), rounds);
    try {
      return new Uint8Array(await crypto.subtle.decrypt({ name: "AES-GCM", iv: fromBase64(nonce) }, key, payload));
    } catch {
      // Written in another way, or wrong.
    }
  }
  throw new WrongPasswordError();
}

/** An "ä" may be one character, or an "a" and a diaeresis: it depends on the keyboard. The planner seals by the former, the command by what its file has. */
function waysToWrite(password: string): Set<string> {
  return new Set([password.normalize("NFC"), password.normalize("NFD"), password]);
}

async function keyOf(password: string, salt: Uint8Array<ArrayBuffer>, rounds: number): Promise<CryptoKey> {
  const secret = await crypto.subtle.importKey("raw", new TextEncoder().encode(password), "PBKDF2", false, ["deriveKey"]);
  const derivation = { name: "PBKDF2", hash: "SHA-256", salt, iterations: rounds };
  return crypto.subtle.deriveKey(derivation, secret, { name: "AES-GCM", length: 256 }, false, ["encrypt", "decrypt"]);
}

async function sha256(bytes: Uint8Array<ArrayBuffer>): Promise<string> {
  const digest = new Uint8Array(await crypto.subtle.digest("SHA-256", bytes));
  return Array.from(digest, (byte) => byte.toString(16).padStart(2, "0")).join("");
}

async function collect(stream: ReadableStream<Uint8Array>): Promise<Uint8Array<ArrayBuffer>> {
  const chunks: Uint8Array[] = [];
  let size = 0;
  const reader = stream.getReader();
  for (let next = await reader.read(); next.value !== undefined; next = await reader.read()) {
    chunks.push(next.value);
    size += next.value.length;
    if (size > MOST_DATA_BYTES) throw new DamagedError();
  }
  const out = new Uint8Array(size);
  let at = 0;
  for (const chunk of chunks) {
    out.set(chunk, at);
    at += chunk.length;
  }
  return out;
}

const CHUNK = 0x6000;

export function toBase64(bytes: Uint8Array): string {
  let text = "";
  for (let i = 0; i < bytes.length; i += CHUNK) text += btoa(String.fromCharCode(...bytes.subarray(i, i + CHUNK)));
  return text;
}

/** Throws a DamagedError if the text is not base64. */
export function fromBase64(text: string): Uint8Array<ArrayBuffer> {
  try {
    const binary = atob(text);
    const bytes = new Uint8Array(binary.length);
    for (let i = 0; i < bytes.length; ++i) bytes[i] = binary.charCodeAt(i);
    return bytes;
  } catch {
    throw new DamagedError();
  }
}
