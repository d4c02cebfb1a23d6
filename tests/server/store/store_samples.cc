// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/server/store/store_samples.h"

#include <memory>
#include <numeric>
#include <random>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

#include "core/base/status_macros.h"
#include "core/mesh/payload/sha256.h"

namespace tissueform {
namespace {

std::string SampleBytes(int number, size_t size) {
  std::mt19937 random(static_cast<unsigned>(number));
  std::string bytes(size, '\0');
  for (char& byte : bytes) byte = static_cast<char>(random());
  return bytes;
}

}  // namespace

MeshPayload SamplePayload(int number, int num_vertices) {
  MeshPayloadShape shape;
  shape.num_vertices = num_vertices;
  shape.num_tets = num_vertices;
  shape.cell_arrays = {"youngs_modulus_pa"};
  MeshPayload payload(shape);
  payload.Write(0, SampleBytes(number, static_cast<size_t>(shape.TotalBytes())));
  return payload;
}

MeshRecord RecordOf(const MeshPayload& payload) {
  const MeshPayloadView view = payload.View();
  MeshRecord record;
  record.sha256 = view.Sha256();
  record.shape = view.shape;
  record.total_bytes = view.shape.TotalBytes();
  return record;
}

UploadAnnouncement AnnouncementOf(const MeshPayload& payload) {
  const MeshRecord record = RecordOf(payload);
  return {record.shape, record.total_bytes, record.sha256};
}

std::string BytesOf(const MeshPayload& payload) {
  return absl::StrJoin(payload.View().segments, "");
}

SessionRecord SampleSession(const std::string& id, int number) {
  SessionRecord record;
  record.id = id;
  record.owner = "planner";
  record.project = absl::StrCat("project ", number);
  record.mesh_sha256 = RecordOf(SamplePayload(1)).sha256;
  record.stiffness = 1000.0 + number;
  record.fixed = {0, 1, number};
  record.handles = {{"chin", {2, 3}}, {"maxilla", {5}}};
  record.node_order.resize(100);
  std::iota(record.node_order.rbegin(), record.node_order.rend(), 0);
  return record;
}

std::vector<HandlePose> SamplePoses(int number) {
  std::vector<HandlePose> poses(2);
  poses[0].translation_mm = {1.0 * number, 2, 3};
  poses[1].rotation_vector = {0, 0.01 * number, 0};
  return poses;
}

PredictionRecord SamplePrediction(const std::string& id, const std::string& owner,
                                  const std::string& session, int64_t vertex_count) {
  PredictionRecord record;
  record.id = id;
  record.owner = owner;
  record.session = session;
  record.mesh_sha256 = std::string(64, 'a');
  record.created_s = 1234;
  record.metadata = std::string("poses\0model\xff of ", 16) + id;
  record.vertex_count = vertex_count;
  return record;
}

std::string SamplePositions(int number, int64_t vertex_count) {
  return SampleBytes(number, static_cast<size_t>(vertex_count) * 12);
}

std::string SampleCase(int number, size_t size) { return SampleBytes(number, size); }

CaseKey SampleCaseKey(const std::string& sha256) { return {.sha256 = sha256, .owner = "planner"}; }

CaseRecord CaseRecordOf(const std::string& bytes) {
  return {.sha256 = Sha256Hex({bytes}),
          .owner = "planner",
          .title = "head, from the right",
          .total_bytes = static_cast<int64_t>(bytes.size()),
          .created_s = 1234,
          .last_used_s = 1234};
}

absl::StatusOr<CaseRecord> KeepCase(CaseStore& store, const CaseRecord& record,
                                    const std::string& bytes, int most) {
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<CaseWriter> writer, store.Begin(record, most));
  const size_t half = bytes.size() / 2;
  TF_RETURN_IF_ERROR(writer->Write(0, absl::string_view(bytes).substr(0, half)));
  TF_RETURN_IF_ERROR(
      writer->Write(static_cast<int64_t>(half), absl::string_view(bytes).substr(half)));
  return writer->Finish();
}

absl::StatusOr<std::string> ReadWholeCase(CaseStore& store, const std::string& sha256,
                                          int64_t now_s) {
  constexpr int64_t kPieceBytes = 999;
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<CaseReader> reader,
                      store.Open(SampleCaseKey(sha256), now_s));
  std::string bytes;
  while (static_cast<int64_t>(bytes.size()) < reader->total_bytes()) {
    TF_ASSIGN_OR_RETURN(const std::string piece,
                        reader->Read(static_cast<int64_t>(bytes.size()), kPieceBytes));
    bytes += piece;
  }
  return bytes;
}

}  // namespace tissueform
