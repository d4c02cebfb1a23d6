// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { fromBinary } from "@bufbuild/protobuf";
import { expect, test } from "vitest";
import { Code } from "../../src/calls/call_error";
import { CallSocket } from "../../src/calls/call_socket";
import { FrameKind, decodeFrame } from "../../src/calls/frame";
import type { Gateway } from "../../src/calls/gateway";
import { UploadCaseRequestSchema } from "../../src/generated/tissueform/v1/case_service_pb";
import { UploadMeshRequestSchema } from "../../src/generated/tissueform/v1/mesh_service_pb";
import { uploadCase, uploadMesh } from "../../src/live/upload";
import { FakeSocket } from "../testing/fake_socket";

const SOURCE = { totalBytes: 10, read: async (offset: number, length: number) => Uint8Array.from({ length }, (_, i) => offset + i) };

/** Servers that end uploads with these codes, one after the other, once all has come; `committed` bytes of a mesh are there. */
function servers(codes: Code[], committed = 0) {
  const sockets: FakeSocket[] = [];
  const asked: unknown[] = [];
  const gateway = {
    open: (method: any, handlers: any, options: any) => {
      const socket = new FakeSocket();
      sockets.push(socket);
      const call = new CallSocket(() => socket, method, handlers, options);
      socket.onopen?.();
      const code = codes.shift() ?? 0;
      const halfClose = call.halfClose.bind(call);
      call.halfClose = () => {
        halfClose();
        setTimeout(() => socket.end(code, "no"));
      };
      return call;
    },
    meshes: {
      queryUpload: async (_: unknown, options: { headers: unknown }) => {
        asked.push(options.headers);
        return { committedBytes: BigInt(committed) };
      },
    },
  } as unknown as Gateway;
  const messages = (socket: FakeSocket) => socket.sent.map(decodeFrame).filter(({ kind }) => kind === FrameKind.Message);
  return { gateway, sockets, asked, messages };
}

test("a case whose server goes away is sent once more, one that is refused is not", async () => {
  const { gateway, sockets, messages } = servers([Code.Unavailable, 0 as Code]);
  const stored = await uploadCase(gateway, SOURCE, "abc", "A face", () => {});
  expect(stored.name).toBe("cases/abc");
  expect(sockets).toHaveLength(2);
  const chunk = fromBinary(UploadCaseRequestSchema, messages(sockets[1])[1].payload).message;
  expect(chunk).toMatchObject({ case: "chunk", value: { writeOffset: 0n, finishWrite: true } });
  const refusing = servers([Code.ResourceExhausted]);
  await expect(uploadCase(refusing.gateway, SOURCE, "abc", "A face", () => {})).rejects.toMatchObject({ code: Code.ResourceExhausted });
  expect(refusing.sockets).toHaveLength(1);
});

test("how much of a mesh has arrived is asked where the rest goes: by its name", async () => {
  const { gateway, sockets, asked, messages } = servers([], 4);
  const mesh = { name: "meshes/m", vertexCount: 4, tetCount: 1, cellArrays: [] } as unknown as Parameters<typeof uploadMesh>[3];
  await uploadMesh(gateway, SOURCE, { offset: 2, length: 8 }, mesh, () => {});
  expect(asked).toEqual([{ "x-tissueform-session": "m" }]);
  expect(sockets[0].start().metadata).toEqual({ "x-tissueform-session": "m" });
  const chunk = fromBinary(UploadMeshRequestSchema, messages(sockets[0])[1].payload).message;
  expect(chunk).toMatchObject({ case: "chunk", value: { writeOffset: 4n, data: new Uint8Array([6, 7, 8, 9]) } });
});
