// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { readFileSync, readdirSync } from "node:fs";
import { dirname, join, relative, resolve } from "node:path";
import { fileURLToPath } from "node:url";
import { expect, test } from "vitest";

/** Each room may import what stands before it. */
const ROOMS = ["generated", "geometry", "volume", "evaluation", "calls", "login", "case", "movingdata", "planning", "measures", "live", "scene", "photograph", "workbench", "exports", "report", "panels", "slices", "sidebyside", "building", "movingfile", "pages"];
const SOURCE = fileURLToPath(new URL("../src", import.meta.url));
const LIBRARIES: Record<string, readonly string[]> = {
  three: ["scene", "photograph", "exports"],
  "dicom-parser": ["volume"],
  "@cornerstonejs": ["volume"],
  "jpeg-lossless-decoder-js": ["volume"],
  fflate: ["volume"],
  "@connectrpc": ["calls"],
  oauth4webapi: ["login"],
  "@bufbuild": ["calls", "case", "measures", "live", "workbench"],
};

const files = ROOMS.slice(1).flatMap((room) => readdirSync(join(SOURCE, room)).map((name) => `${room}/${name}`));

function imports(file: string): string[] {
  const text = readFileSync(join(SOURCE, file), "utf8");
  return Array.from(text.matchAll(/from "([^"]+)"/g), (match) => match[1]);
}

/** Files of `graph` that import each other in a circle, the first one that is found, from a file back to it; [] if there is no circle. */
function findCircle(graph: ReadonlyMap<string, readonly string[]>): string[] {
  const done = new Set<string>();
  const path: string[] = [];
  const visit = (file: string): string[] => {
    if (path.includes(file)) return [...path.slice(path.indexOf(file)), file];
    if (done.has(file)) return [];
    path.push(file);
    for (const target of graph.get(file) ?? []) {
      const circle = visit(target);
      if (circle.length > 0) return circle;
    }
    path.pop();
    done.add(file);
    return [];
  };
  return Array.from(graph.keys()).map(visit).find((circle) => circle.length > 0) ?? [];
}

/** As in "../case/field": without its ending, from the folder of sources. Types count: who reads one file has to read the other. */
function sourceImports(file: string): string[] {
  const targets = imports(file).filter((name) => name.startsWith("."));
  return targets.map((target) => relative(SOURCE, resolve(SOURCE, dirname(file), target.replace(/\?.*$/, ""))));
}

test("no file imports itself by way of others", () => {
  const all = [...files, "main.ts"].filter((file) => file.endsWith(".ts"));
  expect(findCircle(new Map(all.map((file) => [file.replace(/\.ts$/, ""), sourceImports(file)])))).toEqual([]);
});

test("a circle of imports is found wherever it begins", () => {
  const graph = new Map([["a", ["b"]], ["b", ["c"]], ["c", ["d", "b"]], ["d", []]]);
  expect(findCircle(graph)).toEqual(["b", "c", "b"]);
});

test.each(files)("%s imports from rooms below it only", (file) => {
  const room = file.split("/")[0];
  for (const target of imports(file).filter((name) => name.startsWith(".") && !name.includes(".css") && !name.includes(".json"))) {
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
