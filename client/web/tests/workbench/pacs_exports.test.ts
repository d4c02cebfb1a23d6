// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { create, toBinary } from "@bufbuild/protobuf";
import type { MessageInitShape } from "@bufbuild/protobuf";
import { expect, test, vi } from "vitest";
import { CallSocket } from "../../src/calls/call_socket";
import { FrameKind, encodeFrame } from "../../src/calls/frame";
import { ExportSchema, ExportState, WatchExportsResponseSchema } from "../../src/generated/tissueform/v1/export_service_pb";
import { PredictionSchema } from "../../src/generated/tissueform/v1/prediction_pb";
import { PacsExports, exportText, maySend, mayTakeBack } from "../../src/workbench/pacs_exports";
import { FakeSocket } from "../testing/fake_socket";

const CASE = "cases/a";
const UNIMPLEMENTED = 12;
const UNAVAILABLE = 14;

function entry(fields: MessageInitShape<typeof ExportSchema>) {
  return create(ExportSchema, { name: "exports/1", prediction: "predictions/p", case: CASE, state: ExportState.WAITING, etag: "1", ...fields });
}

function pacs() {
  const sockets: FakeSocket[] = [];
  const timers: (() => void)[] = [];
  const listed: ReturnType<typeof entry>[] = [];
  const exports = {
    createExport: vi.fn((request: { prediction: string }) => Promise.resolve(entry({ prediction: request.prediction }))),
    deleteExport: vi.fn(() => Promise.resolve({})),
    listExports: vi.fn(() => Promise.resolve({ exports: listed, nextPageToken: "" })),
  };
  const open = (method: any, handlers: any, options: any) => {
    const socket = new FakeSocket();
    sockets.push(socket);
    const call = new CallSocket(() => socket, method, handlers, options);
    socket.onopen?.();
    return call;
  };
  const subject = new PacsExports({ exports, open } as never, CASE, (action) => (timers.push(action), () => {}));
  subject.start();
  const receive = (message: MessageInitShape<typeof WatchExportsResponseSchema>) => {
    const payload = toBinary(WatchExportsResponseSchema, create(WatchExportsResponseSchema, message));
    sockets[sockets.length - 1].onmessage?.({ data: encodeFrame(FrameKind.Message, payload).buffer });
  };
  const states = () => Array.from(subject.byPrediction.value ?? [], ([prediction, { state }]) => [prediction, state]);
  return { subject, sockets, timers, listed, exports, receive, states };
}

test("the newest of each prediction of the case counts, in whatever order they come", () => {
  const { receive, states } = pacs();
  receive({ export: entry({ name: "exports/2", state: ExportState.STORING, etag: "4" }) });
  receive({ export: entry({ name: "exports/2", state: ExportState.WAITING, etag: "3" }) });
  receive({ export: entry({ name: "exports/1", state: ExportState.FAILED, etag: "9" }) });
  receive({ export: entry({ name: "exports/3", case: "cases/b", prediction: "predictions/q" }) });
  expect(states()).toEqual([["predictions/p", ExportState.STORING]]);
});

test("finished exports are listed once the watch has begun, and removed ones disappear", async () => {
  const { subject, receive, listed, states } = pacs();
  expect(subject.byPrediction.value).toBeNull();
  receive({ export: entry({ prediction: "predictions/gone" }) });
  listed.push(entry({ name: "exports/5", state: ExportState.STORED }));
  receive({});
  await vi.waitFor(() => expect(states()).toEqual([["predictions/p", ExportState.STORED]]));
});

test("a server without exports is asked once, one that breaks off again", () => {
  const old = pacs();
  old.sockets[0].end(UNIMPLEMENTED, "unknown service");
  expect(old.subject.byPrediction.value).toBeNull();
  expect(old.timers).toHaveLength(0);
  const broken = pacs();
  broken.receive({ export: entry({}) });
  broken.sockets[0].end(UNAVAILABLE, "draining");
  expect(broken.timers).toHaveLength(1);
  broken.timers[0]();
  expect(broken.sockets).toHaveLength(2);
  expect(broken.states()).toHaveLength(1);
});

test("a sent export is shown at once, and a withdrawn one is not", async () => {
  const { subject, exports, states } = pacs();
  await subject.send(create(PredictionSchema, { name: "predictions/p" }), []);
  expect(exports.createExport.mock.calls[0]).toMatchObject([{ prediction: "predictions/p", measures: [] }]);
  expect(states()).toEqual([["predictions/p", ExportState.WAITING]]);
  await subject.takeBack(entry({}));
  expect(exports.deleteExport).toHaveBeenCalledWith({ name: "exports/1" });
  expect(states()).toEqual([]);
});

test("a refusal is reported", async () => {
  const { subject, exports } = pacs();
  exports.createExport.mockRejectedValueOnce(new Error("no"));
  await expect(subject.send(create(PredictionSchema, { name: "predictions/p" }), [])).rejects.toThrow("no");
});

test.each([
  ["waiting for the bridge", ExportState.WAITING, "", true, false],
  ["waits for confirmation on the review page", ExportState.CONFIRMATION, "", true, false],
  ["storing, 3 objects so far", ExportState.STORING, "", false, false],
  ["stored, 3 objects", ExportState.STORED, "", false, false],
  ["failed: the PACS refuses it", ExportState.FAILED, "the PACS refuses it", false, true],
])("%s", (text, state, detail, takeBack, again) => {
  const subject = entry({ state, detail, storedObjects: 3 });
  expect(exportText(subject)).toBe(text);
  expect(mayTakeBack(subject)).toBe(takeBack);
  expect(maySend(subject)).toBe(again);
});
