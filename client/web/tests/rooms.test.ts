// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { readFileSync, readdirSync } from "node:fs";
import { dirname, join, relative, resolve } from "node:path";
import { fileURLToPath } from "node:url";
import { expect, test } from "vitest";

/** Each room may import what stands before it. */
const ROOMS = ["generated", "geometry", "evaluation", "calls", "login", "case", "movingdata", "planning", "measures", "live", "scene", "workbench", "exports", "report", "panels", "movingfile", "pages"];
const SOURCE = fileURLToPath(new URL("../src", import.meta.url));
const LIBRARIES: Record<string, readonly string[]> = {
  three: ["scene", "exports"],
  "@connectrpc": ["calls"],
  oauth4webapi: ["login"],
  "@bufbuild": ["calls", "case", "measures", "live", "workbench"],
};

const files = ROOMS.slice(1).flatMap((room) => readdirSync(join(SOURCE, room)).map((name) => `${room}/${name}`));

function imports(file: string): string[] {
  const text = readFileSync(join(SOURCE, file), "utf8");
  return Array.from(text.matchAll(/from "([^"]+)"/g), (match) => match[1]);
}

test.each(files)("%s imports from rooms below it only", (file) => {
  const room = file.split("/")[0];
  for (const target of imports(file).filter((name) => name.startsWith(".") && !name.includes(".css"))) {
    const other = relative(SOURCE, resolve(SOURCE, dirname(file), target)).split("/")[0];
    expect(ROOMS.indexOf(other), `${file} imports ${target}`).toBeLessThanOrEqual(ROOMS.indexOf(room));
    expect(ROOMS).toContain(other);
  }
});

test.each(files)("%s imports libraries where they belong", (file) => {
  const room = file.split("/")[0];
  for (const target of imports(file).filter((name) => !name.startsWith("."))) {
    const library = target.split("/")[0];
    expect(LIBRARIES[library], `${file} imports ${target}`).toContain(room);
  }
});
