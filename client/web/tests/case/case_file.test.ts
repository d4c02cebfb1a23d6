// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { describe, expect, test } from "vitest";
import { openCase } from "../../src/case/case_file";
import { CaseError } from "../../src/case/field";
import { type CaseChanges, container, smallCase, sourceOf } from "../testing/small_case";

const open = (bytes: Uint8Array<ArrayBuffer>) => openCase(sourceOf(bytes));
const manifestOf = (json: any) => json.extensions.TISSUEFORM_case;

describe("a case", () => {
  test("opens with all that it holds", async () => {
    const file = await open(smallCase());
    expect(file.manifest.title).toBe("small");
    expect(file.surfaces.map((surface) => surface.entry.kind)).toEqual(["skin", "segment", "bone"]);
    expect(Array.from(file.surfaces[0].triangles)).toEqual([0, 1, 2, 1, 3, 2]);
    expect(file.manifest.handles[0].limits).toEqual({ translationMm: 15, rotationDeg: 20 });
    expect(file.manifest.landmarks[1].skinVertex).toBe(0);
    expect(file.sessionRequest.handles[0].name).toBe("mandible");
    expect(file.meshPayload.length).toBe(24 * 5 + 16 * 2 + 8 * 2);
    expect(Array.from(file.restPositions.slice(12))).toEqual([10, 10, 10]);
  });

  test("is followed at vertices with a weight and at three of each segment", async () => {
    const file = await open(smallCase());
    expect(Array.from(file.followed)).toEqual([0, 1, 2, 4]);
    expect(file.probes[0]?.slice().sort()).toEqual([0, 1, 2]);
    const { places, weights } = file.surfaces[0].follows!;
    expect(file.followed[places[0]]).toBe(0);
    expect(file.followed[places[8]]).toBe(4);
    expect(weights[8]).toBe(1);
  });

  test("is read without its mesh beyond the positions", async () => {
    const bytes = smallCase();
    const source = sourceOf(bytes);
    let furthest = 0;
    await openCase({ ...source, read: (offset, length) => ((furthest = Math.max(furthest, offset + length)), source.read(offset, length)) });
    expect(furthest).toBeLessThanOrEqual(bytes.length - 16 * 2 - 8 * 2);
  });

  test.each<[string, CaseChanges, string]>([
    ["another format", { json: (json) => (manifestOf(json).format = "other") }, "format"],
    ["a later version", { json: (json) => (manifestOf(json).version = 3) }, "newer one"],
    ["no extension", { json: (json) => delete json.extensions }, "extensions"],
    ["a view past the end", { json: (json) => (json.bufferViews[0].byteLength = 1e9) }, "bufferViews[0].byteLength"],
    ["a view at a negative place", { json: (json) => (json.bufferViews[0].byteOffset = -4) }, "bufferViews[0].byteOffset"],
    ["a view at half a byte", { json: (json) => (json.bufferViews[0].byteOffset = 0.5) }, "bufferViews[0].byteOffset"],
    ["an accessor past its view", { json: (json) => (json.accessors[0].count = 5) }, "accessors[0]"],
    ["an accessor of 2 GB", { json: (json) => (json.accessors[1].count = 2 ** 29) }, "accessors[1].count"],
    ["indices that are no triangles", { json: (json) => (json.accessors[1].count = 5) }, "three a triangle"],
    ["a mesh of another number of bytes", { json: (json) => (manifestOf(json).mesh.tet_count = 3) }, "its counts say"],
    ["a mesh that lies about its vertices", { json: (json) => (manifestOf(json).mesh.vertex_count = 2 ** 31 - 1) }, "its counts say"],
    ["a handle whose name is a number", { json: (json) => (manifestOf(json).handles[0].name = 7) }, "handles[0].name"],
    ["two handles of one name", { json: (json) => manifestOf(json).handles.push(manifestOf(json).handles[0]) }, "name of its own"],
    ["a segment of no handle", { json: (json) => delete manifestOf(json).surfaces[1].handle }, "surfaces[1].handle"],
    ["a segment of an unknown handle", { json: (json) => (manifestOf(json).surfaces[1].handle = "chin") }, "surfaces[1].handle"],
    ["an unknown kind", { json: (json) => (manifestOf(json).surfaces[0].kind = "hair") }, "surfaces[0].kind"],
    ["a limit of nothing", { json: (json) => (manifestOf(json).handles[0].limits.rotation_deg = 0) }, "rotation_deg"],
    ["a skewed head frame", { json: (json) => (manifestOf(json).head_frame.left = [1, 1, 0]) }, "head_frame"],
    ["a mirrored head frame", { json: (json) => (manifestOf(json).head_frame.left = [-1, 0, 0]) }, "head_frame"],
    ["a landmark past the skin", { json: (json) => (manifestOf(json).landmarks[1].skin_vertex = 4) }, "soft_pogonion"],
    ["65 surfaces", { json: (json) => (manifestOf(json).surfaces = Array(65).fill(manifestOf(json).surfaces[0])) }, "surfaces"],
    ["a session of another mesh", { json: (json) => (manifestOf(json).mesh.name = `meshes/${"b".repeat(64)}`) }, "another mesh"],
    ["a session of other handles", { handle: "maxilla" }, "other handles"],
    ["a session request that is none", { json: (json) => (manifestOf(json).session_request = 3) }, "session request"],
    ["a triangle past the vertices", { triangles: [0, 1, 4, 1, 3, 2] }, "past its 4"],
    ["a vertex followed that is not there", { follows: [0, 1, 5, 1, 2, 3, 2, 3, 4, 0, 0, 0] }, "does not have"],
    ["a negative vertex followed", { follows: [0, 1, -1, 1, 2, 3, 2, 3, 4, 0, 0, 0] }, "does not have"],
    ["weights over one", { weights: [1, 1, 0, 0.5, 0.5, 0, 0, 0, 1, 0, 0, 0] }, "weights"],
    ["a weight that is no number", { weights: [NaN, 0, 0, 0.5, 0.5, 0, 0, 0, 1, 0, 0, 0] }, "weights"],
    ["too few weights", { weights: [1, 0, 0] }, "three weights"],
  ])("with %s is refused by name", async (_, changes, text) => {
    const failure = open(smallCase(changes));
    await expect(failure).rejects.toThrow(CaseError);
    await expect(failure).rejects.toThrow(text);
  });

  test("cut off anywhere is refused", async () => {
    const bytes = smallCase();
    for (let length = 0; length < bytes.length; length += 7) {
      await expect(open(bytes.slice(0, length))).rejects.toThrow(CaseError);
    }
  });

  test("with any byte changed opens or is refused by a CaseError", async () => {
    const bytes = smallCase();
    for (let at = 0; at < bytes.length; at += 3) {
      const damaged = bytes.slice();
      damaged[at] ^= 0x5a;
      await open(damaged).catch((error) => expect(error).toBeInstanceOf(CaseError));
    }
  });

  test("of names with script in them keeps them as texts", async () => {
    const title = "<img src=x onerror=alert(1)>";
    expect((await open(smallCase({ json: (json) => (manifestOf(json).title = title) }))).manifest.title).toBe(title);
  });

  test("does not let JSON reach into prototypes", async () => {
    const json = '{"__proto__": {"extensions": {}}, "bufferViews": [], "accessors": [], "meshes": []}';
    await expect(open(container(json, new Uint8Array(4)))).rejects.toThrow(CaseError);
  });
});
