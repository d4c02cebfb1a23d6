// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { DroppedFile } from "./opened_ct";

/** More than any CT has: a whole disk was dropped. */
const MOST_FILES = 50_000;

/** Of a file field, of files or of a folder. */
export function filesOf(list: FileList | null): DroppedFile[] {
  return Array.from(list ?? [], (file) => ({ path: file.webkitRelativePath === "" ? file.name : file.webkitRelativePath, file }));
}

/** What was dropped, with all that is in folders. Call it within the event: the browser forgets the items after it. Rejects with an Error in a sentence. */
export function droppedFiles(transfer: DataTransfer): Promise<DroppedFile[]> {
  const entries = Array.from(transfer.items, (item) => item.webkitGetAsEntry()).filter((entry) => entry !== null);
  return collect(entries);
}

async function collect(entries: FileSystemEntry[]): Promise<DroppedFile[]> {
  const files: DroppedFile[] = [];
  const waiting = [...entries];
  for (let entry = waiting.pop(); entry !== undefined; entry = waiting.pop()) {
    if (entry.isDirectory) waiting.push(...(await entriesOf(entry as FileSystemDirectoryEntry)));
    else files.push(await fileOf(entry as FileSystemFileEntry));
    if (files.length > MOST_FILES) throw new Error(`more than ${MOST_FILES} files were dropped: drop the folder of one study`);
  }
  return files;
}

/** A reader gives the entries of a folder in parts, and none at its end. */
async function entriesOf(folder: FileSystemDirectoryEntry): Promise<FileSystemEntry[]> {
  const reader = folder.createReader();
  const all: FileSystemEntry[] = [];
  for (;;) {
    const part = await new Promise<FileSystemEntry[]>((resolve, reject) => reader.readEntries(resolve, reject)).catch(() => unreadable());
    if (part.length === 0) return all;
    all.push(...part);
  }
}

function fileOf(entry: FileSystemFileEntry): Promise<DroppedFile> {
  return new Promise<DroppedFile>((resolve, reject) => entry.file((file) => resolve({ path: entry.fullPath, file }), reject)).catch(() => unreadable());
}

// The browser's own message names the file, and a file's name may name the patient.
function unreadable(): never {
  throw new Error("a dropped file cannot be read: check that the folder is still there, then drop it again");
}
