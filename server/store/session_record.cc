// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/session_record.h"

#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "google/protobuf/io/coded_stream.h"
#include "google/protobuf/io/zero_copy_stream_impl_lite.h"

#include "core/base/status_macros.h"
#include "core/mesh/payload/sha256.h"
#include "proto/conversion/contact_conversion.h"
#include "proto/conversion/geometry_conversion.h"
#include "proto/conversion/model_conversion.h"
#include "tissueform/store/v1/session_record.pb.h"

namespace tissueform {
namespace {

absl::Status Damaged(absl::string_view what) {
  return absl::DataLossError(absl::StrCat("a session record is damaged: ", what));
}

absl::Status ReadStiffness(const v1::Stiffness& stiffness, SessionRecord* record) {
  switch (stiffness.source_case()) {
    case v1::Stiffness::kUniformPa:
      record->stiffness = stiffness.uniform_pa();
      return absl::OkStatus();
    case v1::Stiffness::kCellArray:
      record->stiffness = stiffness.cell_array();
      return absl::OkStatus();
    case v1::Stiffness::SOURCE_NOT_SET:
      break;
  }
  return Damaged("it has no stiffness");
}

// Marks the vertices one by one: what comes twice or lies outside is found at once.
bool IsPermutation(const std::vector<int32_t>& order) {
  std::vector<bool> seen(order.size());
  for (const int32_t vertex : order) {
    if (vertex < 0 || static_cast<size_t>(vertex) >= order.size() || seen[vertex]) return false;
    seen[vertex] = true;
  }
  return true;
}

absl::Status ReadPoses(const store::v1::SessionRecord& proto, SessionRecord* record) {
  if (!proto.last_poses().empty() && proto.last_poses_size() != proto.handles_size()) {
    return Damaged(absl::StrCat("it has ", proto.last_poses_size(), " poses for ",
                                proto.handles_size(), " handles"));
  }
  for (int h = 0; h < proto.last_poses_size(); ++h) {
    NamedPose pose = ToNamedPose(proto.last_poses(h));
    if (pose.handle != proto.handles(h).name() || !CheckPose(pose.pose).ok()) {
      return Damaged(absl::StrCat("pose ", h, " does not belong to its handle"));
    }
    record->last_poses.push_back(pose.pose);
  }
  return absl::OkStatus();
}

// Equal for equal messages.
std::string Bytes(const google::protobuf::MessageLite& message) {
  std::string bytes;
  google::protobuf::io::StringOutputStream stream(&bytes);
  google::protobuf::io::CodedOutputStream output(&stream);
  output.SetSerializationDeterministic(true);
  message.SerializeToCodedStream(&output);
  output.Trim();
  return bytes;
}

bool Parse(absl::string_view bytes, google::protobuf::MessageLite* message) {
  return bytes.size() <= std::numeric_limits<int>::max() &&
         message->ParseFromArray(bytes.data(), static_cast<int>(bytes.size()));
}

}  // namespace

std::string SerializeRecord(const SessionRecord& record) {
  store::v1::SessionRecord proto;
  proto.set_id(record.id);
  proto.set_owner(record.owner);
  proto.set_project(record.project);
  proto.set_mesh_sha256(record.mesh_sha256);
  if (const double* uniform_pa = std::get_if<double>(&record.stiffness)) {
    proto.mutable_stiffness()->set_uniform_pa(*uniform_pa);
  } else {
    proto.mutable_stiffness()->set_cell_array(std::get<std::string>(record.stiffness));
  }
  proto.mutable_fixed_vertices()->Add(record.fixed.begin(), record.fixed.end());
  for (const HandleRegion& region : record.handles) {
    v1::Handle* handle = proto.add_handles();
    handle->set_name(region.name);
    handle->mutable_vertices()->Add(region.vertices.begin(), region.vertices.end());
  }
  *proto.mutable_contact() = ToProto(record.contact, record.handles);
  if (record.lip_edge) *proto.mutable_lip_edge() = ToProto(*record.lip_edge, record.seals_lips);
  proto.set_model(ToProto(record.model));
  proto.set_poisson_ratio(record.poisson_ratio);
  *proto.mutable_gradient_field() = ToProto(record.gradient_field);
  for (size_t h = 0; h < record.last_poses.size(); ++h) {
    *proto.add_last_poses() = ToProto(NamedPose{record.handles[h].name, record.last_poses[h]});
  }
  proto.set_request_id(record.request_id);
  proto.set_request_fingerprint(record.request_fingerprint);
  proto.mutable_node_order()->Add(record.node_order.begin(), record.node_order.end());
  return Bytes(proto);
}

absl::StatusOr<SessionRecord> ParseRecord(absl::string_view bytes) {
  store::v1::SessionRecord proto;
  if (!Parse(bytes, &proto)) return Damaged("it is not a record");
  if (proto.id().empty()) return Damaged("it has no id");
  if (!IsSha256Hex(proto.mesh_sha256())) return Damaged("its mesh has no name");
  SessionRecord record;
  record.id = proto.id();
  record.owner = proto.owner();
  record.project = proto.project();
  record.mesh_sha256 = proto.mesh_sha256();
  TF_RETURN_IF_ERROR(ReadStiffness(proto.stiffness(), &record));
  record.fixed = {proto.fixed_vertices().begin(), proto.fixed_vertices().end()};
  for (const v1::Handle& handle : proto.handles()) {
    record.handles.push_back({handle.name(), {handle.vertices().begin(), handle.vertices().end()}});
  }
  absl::StatusOr<std::vector<ContactRow>> contact = ToContactRows(proto.contact(), record.handles);
  if (!contact.ok()) return Damaged(contact.status().message());
  record.contact = *std::move(contact);
  if (proto.has_lip_edge()) {
    record.lip_edge = ToLipEdge(proto.lip_edge());
    record.seals_lips = proto.lip_edge().sealed();
  }
  const absl::StatusOr<DeformationModel> model =
      ToModel(proto.model(), DeformationModel::kGradientField);
  if (!model.ok()) return Damaged(model.status().message());
  record.model = *model;
  record.poisson_ratio = proto.poisson_ratio();
  absl::StatusOr<GradientFieldOptions> gradient_field =
      ToGradientFieldOptions(proto.gradient_field(), std::numeric_limits<int>::max());
  if (!gradient_field.ok()) return Damaged(gradient_field.status().message());
  record.gradient_field = *std::move(gradient_field);
  TF_RETURN_IF_ERROR(ReadPoses(proto, &record));
  record.request_id = proto.request_id();
  record.request_fingerprint = proto.request_fingerprint();
  record.node_order = {proto.node_order().begin(), proto.node_order().end()};
  if (!IsPermutation(record.node_order))
    return Damaged("its order of vertices is not a permutation");
  return record;
}

std::string SerializePoses(const std::vector<HandlePose>& poses) {
  store::v1::Poses proto;
  for (const HandlePose& pose : poses) *proto.add_poses() = ToProto(NamedPose{"", pose});
  return Bytes(proto);
}

absl::StatusOr<std::vector<HandlePose>> ParsePoses(absl::string_view bytes) {
  store::v1::Poses proto;
  if (!Parse(bytes, &proto)) return Damaged("its poses are unreadable");
  std::vector<HandlePose> poses;
  poses.reserve(proto.poses_size());
  for (const v1::HandlePose& pose : proto.poses()) {
    poses.push_back(ToNamedPose(pose).pose);
    if (!CheckPose(poses.back()).ok()) {
      return Damaged(absl::StrCat("pose ", poses.size() - 1, " is invalid"));
    }
  }
  return poses;
}

}  // namespace tissueform
