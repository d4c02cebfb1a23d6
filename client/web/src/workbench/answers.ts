// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import type { MessageInitShape } from "@bufbuild/protobuf";
import { toCallError } from "../calls/call_error";
import { type Gateway, sessionMetadata } from "../calls/gateway";
import type { CaseFile } from "../case/case_file";
import { firstAtPlace, keptCount } from "../case/sticking";
import type { SolveSummary } from "../generated/tissueform/v1/deform_service_pb";
import type { DeformationModel } from "../generated/tissueform/v1/session_pb";
import type { FitRequestSchema, FitResponse } from "../generated/tissueform/v1/plan_service_pb";
import type { ReadPositionsResponse } from "../generated/tissueform/v1/prediction_service_pb";
import type { Prediction } from "../generated/tissueform/v1/prediction_pb";
import type { Pose } from "../geometry/pose";
import { toMessages } from "../live/pose_messages";
import { randomId } from "../live/session_opening";
import { clipTitle } from "../live/upload";
import { pick, subtractInto } from "./face_colors";

const PAGE_SIZE = 200;
/** A model that is asked for the first time prepares itself before it answers. */
const ANSWER_DEADLINE_MS = 300_000;
const MOST_KEPT = 8;

/** Answers that the server computes apart from the drag: predictions, and what another model says. All reject with a CallError. */
export class Answers {
  private readonly kept = new Map<string, Float32Array>();

  /** `rest`: of CaseFile.followed. */
  constructor(
    private readonly gateway: Gateway,
    private readonly file: CaseFile,
    private readonly caseName: string,
    private readonly rest: Float32Array,
  ) {}

  /** Displacements of CaseFile.followed by `model` under `poses`. */
  async ofModel(session: string, model: DeformationModel, poses: Pose[]): Promise<Float32Array> {
    return (await this.solve(session, model, poses)).displacements;
  }

  /** The same, with how good it is. */
  async solve(session: string, model: DeformationModel, poses: Pose[]): Promise<{ displacements: Float32Array; summary: SolveSummary | null }> {
    const vertices = { selection: { case: "list" as const, value: { vertices: Array.from(this.file.followed) } } };
    const request = { session, model, poses: toMessages(this.names, poses), vertices };
    const options = { headers: sessionMetadata(session), timeoutMs: ANSWER_DEADLINE_MS };
    const { positions, summary } = await this.call(() => this.gateway.deform.deformOnce(request, options));
    return { displacements: this.displacements(asFloatArray(positions)), summary: summary ?? null };
  }

  /** Solves in full and keeps the answer under this title. */
  store(session: string, model: DeformationModel | undefined, poses: Pose[], title: string): Promise<Prediction> {
    const request = { session, model, poses: toMessages(this.names, poses), title: clipTitle(title), case: this.caseName, requestId: randomId() };
    const options = { headers: sessionMetadata(session), timeoutMs: ANSWER_DEADLINE_MS };
    return this.call(() => this.gateway.predictions.createPrediction(request, options));
  }

  /** Which poses give the face that is wanted; the first call for given points prepares answers for them. */
  fit(request: MessageInitShape<typeof FitRequestSchema>): Promise<FitResponse> {
    const options = { headers: sessionMetadata(request.session ?? ""), timeoutMs: ANSWER_DEADLINE_MS };
    return this.call(() => this.gateway.plans.fit(request, options));
  }

  /** Of this case, the newest first. */
  async list(): Promise<Prediction[]> {
    const predictions: Prediction[] = [];
    let pageToken = "";
    do {
      const page = await this.call(() => this.gateway.predictions.listPredictions({ pageSize: PAGE_SIZE, pageToken, case: this.caseName }));
      predictions.push(...page.predictions);
      pageToken = page.nextPageToken;
    } while (pageToken !== "");
    return predictions.sort((a, b) => Number((b.createTime?.seconds ?? 0n) - (a.createTime?.seconds ?? 0n)));
  }

  /** Displacements of CaseFile.followed; the last eight are kept. */
  async ofPrediction(prediction: Prediction): Promise<Float32Array> {
    const known = this.kept.get(prediction.name);
    if (known !== undefined) return known;
    const vertices = this.verticesIn(prediction);
    const total = 12 * Number(prediction.vertexCount);
    const bytes = await this.call(() => collect(this.gateway.predictions.readPositions({ name: prediction.name }), total));
    const displacements = this.displacements(pick(asFloatArray(bytes), vertices));
    if (this.kept.size >= MOST_KEPT) this.kept.delete(this.kept.keys().next().value ?? "");
    this.kept.set(prediction.name, displacements);
    return displacements;
  }

  /** CaseFile.followed as the prediction's mesh numbers them: without contact it has no doubles of the seam. */
  private verticesIn({ vertexCount }: Prediction): Int32Array {
    const { file } = this;
    const count = Number(vertexCount);
    if (count === file.manifest.mesh.vertexCount) return file.followed;
    if (count === file.parted?.manifest.mesh.vertexCount) throw new Error("the prediction was made where lips part and slide: choose that under Contact to compare it");
    const first = firstAtPlace(file.restPositions, file.sessionRequest.contact);
    if (count !== keptCount(first)) throw new Error("the prediction has a different mesh from the case");
    return file.followed.map((vertex) => first[vertex]);
  }

  async remove(prediction: Prediction): Promise<void> {
    await this.call(() => this.gateway.predictions.deletePrediction({ name: prediction.name }));
    this.kept.delete(prediction.name);
  }

  private get names(): string[] {
    return this.file.manifest.handles.map((handle) => handle.name);
  }

  private displacements(positions: Float32Array): Float32Array {
    if (positions.length !== this.rest.length) throw new Error("the answer has another number of vertices than requested");
    return subtractInto(positions, this.rest, new Float32Array(positions.length));
  }

  private async call<T>(run: () => Promise<T>): Promise<T> {
    try {
      return await run();
    } catch (thrown) {
      throw toCallError(thrown);
    }
  }
}

/** Little-endian numbers wherever they lie. */
function asFloatArray(bytes: Uint8Array): Float32Array {
  if (bytes.length % 4 !== 0) throw new Error(`${bytes.length} bytes are no whole numbers`);
  return new Float32Array(bytes.slice().buffer);
}

/** All chunks of a download that has `total` bytes. */
async function collect(stream: AsyncIterable<ReadPositionsResponse>, total: number): Promise<Uint8Array> {
  const bytes = new Uint8Array(total);
  let done = 0;
  for await (const { chunk } of stream) {
    const data = chunk?.data ?? new Uint8Array();
    if (Number(chunk?.offset ?? 0n) !== done || done + data.length > total) throw new Error("the prediction has a different mesh from the case");
    bytes.set(data, done);
    done += data.length;
  }
  if (done !== total) throw new Error("the prediction has a different mesh from the case");
  return bytes;
}
