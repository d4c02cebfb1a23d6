// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/store_records.h"

#include <limits>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/mesh/payload/sha256.h"
#include "server/store/store_errors.h"
#include "tissueform/store/v1/store_records.pb.h"

namespace tissueform {
namespace {

constexpr size_t kSealBytes = 64;
// Far beyond what any server takes; so that sizes fit into 64 bits, for any record.
constexpr int64_t kMaxElements = int64_t{1} << 40;
constexpr int kMaxCellArrays = 1 << 10;

bool Parse(absl::string_view bytes, google::protobuf::MessageLite* message) {
  return bytes.size() <= std::numeric_limits<int>::max() &&
         message->ParseFromArray(bytes.data(), static_cast<int>(bytes.size()));
}

void SetShape(const MeshPayloadShape& shape, store::v1::MeshShape* proto) {
  proto->set_num_vertices(shape.num_vertices);
  proto->set_num_tets(shape.num_tets);
  for (const std::string& name : shape.cell_arrays) proto->add_cell_arrays(name);
}

MeshPayloadShape ToShape(const store::v1::MeshShape& proto) {
  return {proto.num_vertices(),
          proto.num_tets(),
          {proto.cell_arrays().begin(), proto.cell_arrays().end()}};
}

bool Fits(const MeshPayloadShape& shape, int64_t total_bytes) {
  return shape.num_vertices >= 0 && shape.num_vertices <= kMaxElements && shape.num_tets >= 0 &&
         shape.num_tets <= kMaxElements && shape.cell_arrays.size() <= kMaxCellArrays &&
         total_bytes == shape.TotalBytes();
}

}  // namespace

std::string SerializeMesh(const MeshRecord& record) {
  store::v1::MeshRecord proto;
  proto.set_sha256(record.sha256);
  SetShape(record.shape, proto.mutable_shape());
  proto.set_total_bytes(record.total_bytes);
  proto.set_created_s(record.created_s);
  proto.set_skin_vertex_count(record.skin_vertex_count);
  return proto.SerializeAsString();
}

absl::StatusOr<MeshRecord> ParseMesh(absl::string_view bytes) {
  store::v1::MeshRecord proto;
  if (!Parse(bytes, &proto)) return Damaged("a mesh's record", "it is unreadable");
  MeshRecord record;
  record.sha256 = proto.sha256();
  record.shape = ToShape(proto.shape());
  record.total_bytes = proto.total_bytes();
  record.created_s = proto.created_s();
  record.skin_vertex_count = proto.skin_vertex_count();
  if (!IsSha256Hex(record.sha256)) return Damaged("a mesh's record", "it has no name");
  if (!Fits(record.shape, record.total_bytes)) {
    return Damaged("a mesh's record", "its size does not match its shape");
  }
  return record;
}

std::string SerializeAnnouncement(const UploadAnnouncement& announcement) {
  store::v1::UploadAnnouncement proto;
  proto.set_sha256(announcement.sha256);
  SetShape(announcement.shape, proto.mutable_shape());
  proto.set_total_bytes(announcement.total_bytes);
  proto.set_owner(announcement.owner);
  return proto.SerializeAsString();
}

absl::StatusOr<UploadAnnouncement> ParseAnnouncement(absl::string_view bytes) {
  store::v1::UploadAnnouncement proto;
  if (!Parse(bytes, &proto)) return Damaged("an upload's announcement", "it is unreadable");
  UploadAnnouncement announcement{ToShape(proto.shape()), proto.total_bytes(), proto.sha256(),
                                  proto.owner()};
  if (const absl::Status status = CheckAnnouncement(announcement); !status.ok()) {
    return Damaged("an upload's announcement", status.message());
  }
  return announcement;
}

std::string SerializePrediction(const PredictionRow& row) {
  store::v1::PredictionRecord proto;
  proto.set_id(row.record.id);
  proto.set_owner(row.record.owner);
  proto.set_session(row.record.session);
  proto.set_mesh_sha256(row.record.mesh_sha256);
  proto.set_created_s(row.record.created_s);
  proto.set_metadata(row.record.metadata);
  proto.set_vertex_count(row.record.vertex_count);
  proto.set_positions_sha256(row.positions_sha256);
  proto.set_case_sha256(row.record.case_sha256);
  return proto.SerializeAsString();
}

absl::StatusOr<PredictionRow> ParsePrediction(absl::string_view bytes) {
  store::v1::PredictionRecord proto;
  if (!Parse(bytes, &proto)) return Damaged("a prediction's record", "it is unreadable");
  if (proto.id().empty()) return Damaged("a prediction's record", "it has no id");
  if (!IsSha256Hex(proto.positions_sha256()) || proto.vertex_count() < 0 ||
      proto.vertex_count() > kMaxElements) {
    return Damaged("a prediction's record", "it names no positions");
  }
  PredictionRow row;
  row.record.id = proto.id();
  row.record.owner = proto.owner();
  row.record.session = proto.session();
  row.record.mesh_sha256 = proto.mesh_sha256();
  row.record.created_s = proto.created_s();
  row.record.metadata = proto.metadata();
  row.record.vertex_count = proto.vertex_count();
  row.record.case_sha256 = proto.case_sha256();
  row.positions_sha256 = proto.positions_sha256();
  return row;
}

std::string SerializeCaseRecord(const CaseRecord& record) {
  store::v1::CaseRecord proto;
  proto.set_sha256(record.sha256);
  proto.set_owner(record.owner);
  proto.set_title(record.title);
  proto.set_total_bytes(record.total_bytes);
  proto.set_created_s(record.created_s);
  proto.set_project(record.project);
  return proto.SerializeAsString();
}

absl::StatusOr<CaseRecord> ParseCaseRecord(absl::string_view bytes) {
  store::v1::CaseRecord proto;
  if (!Parse(bytes, &proto)) return Damaged("a case's record", "it is unreadable");
  CaseRecord record{.sha256 = proto.sha256(),
                    .owner = proto.owner(),
                    .project = proto.project(),
                    .title = proto.title(),
                    .total_bytes = proto.total_bytes(),
                    .created_s = proto.created_s()};
  if (const absl::Status status = CheckCaseRecord(record); !status.ok()) {
    return Damaged("a case's record", status.message());
  }
  return record;
}

absl::Status CheckAnnouncement(const UploadAnnouncement& announcement) {
  TF_RETURN_IF_ERROR(CheckMeshName(announcement.sha256));
  if (Fits(announcement.shape, announcement.total_bytes)) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("the upload of ", announcement.sha256,
                                                 " announces ", announcement.total_bytes,
                                                 " bytes, which does not match its shape"));
}

std::string Seal(absl::string_view bytes) { return absl::StrCat(Sha256Hex({bytes}), bytes); }

absl::StatusOr<absl::string_view> Unseal(absl::string_view sealed) {
  const absl::string_view bytes = sealed.substr(std::min(kSealBytes, sealed.size()));
  if (Sha256Hex({bytes}) == sealed.substr(0, kSealBytes)) return bytes;
  return Damaged("a record", "its bytes have changed");
}

}  // namespace tissueform
