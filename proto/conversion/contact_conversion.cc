// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "proto/conversion/contact_conversion.h"

#include <algorithm>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/mechanics/deformation/linear_elastic_deformer.h"
#include "proto/conversion/geometry_conversion.h"

namespace tissueform {
namespace {

absl::Status BadRow(int number, absl::string_view what) {
  return absl::InvalidArgumentError(absl::StrCat("contact row ", number, " ", what));
}

absl::Status ReadOther(int number, const v1::ContactRow& proto,
                       const std::vector<HandleRegion>& handles, ContactRow* row) {
  switch (proto.other_case()) {
    case v1::ContactRow::kHandle: {
      const auto found = std::ranges::find(handles, proto.handle(), &HandleRegion::name);
      if (found == handles.end()) {
        return BadRow(number, "names a handle that the request does not have; add it to handles");
      }
      row->handle = static_cast<int>(found - handles.begin());
      return absl::OkStatus();
    }
    case v1::ContactRow::kFixedBone:
      if (proto.fixed_bone()) return absl::OkStatus();
      return BadRow(number, "has fixed_bone false; set it to true, or handle or other_vertex");
    case v1::ContactRow::kOtherVertex:
      if (proto.other_vertex() < 0) {
        return BadRow(number, absl::StrCat("names vertex ", proto.other_vertex(),
                                           "; other_vertex must be 0 or more"));
      }
      row->other = proto.other_vertex();
      return absl::OkStatus();
    case v1::ContactRow::OTHER_NOT_SET:
      break;
  }
  return BadRow(number, "touches nothing; set handle, fixed_bone or other_vertex");
}

}  // namespace

ContactRowProtos ToProto(const std::vector<ContactRow>& rows,
                         const std::vector<HandleRegion>& handles) {
  ContactRowProtos protos;
  for (const ContactRow& row : rows) {
    v1::ContactRow* proto = protos.Add();
    proto->set_vertex(row.vertex);
    if (row.other != ContactRow::kBone) {
      proto->set_other_vertex(row.other);
    } else if (row.handle == ContactRow::kFixedBone) {
      proto->set_fixed_bone(true);
    } else {
      proto->set_handle(handles[static_cast<size_t>(row.handle)].name);
    }
    *proto->mutable_normal() = ToProto(row.normal);
    proto->set_gap_mm(row.gap_mm);
    proto->set_bilateral(row.bilateral);
  }
  return protos;
}

absl::StatusOr<std::vector<ContactRow>> ToContactRows(const ContactRowProtos& protos,
                                                      const std::vector<HandleRegion>& handles) {
  if (protos.size() > static_cast<int>(kMaxContactRows)) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the request has ", protos.size(), " contact rows; send ", kMaxContactRows, " at most"));
  }
  std::vector<ContactRow> rows;
  for (int number = 0; number < protos.size(); ++number) {
    const v1::ContactRow& proto = protos[number];
    ContactRow row{.vertex = proto.vertex(),
                   .normal = ToVector(proto.normal()),
                   .gap_mm = proto.gap_mm(),
                   .bilateral = proto.bilateral()};
    TF_RETURN_IF_ERROR(ReadOther(number, proto, handles, &row));
    rows.push_back(row);
  }
  return rows;
}

v1::LipEdge ToProto(const LipEdge& edge, bool sealed) {
  v1::LipEdge proto;
  *proto.mutable_up() = ToProto(edge.up);
  for (const LipEdge::Pair& pair : edge.pairs) {
    v1::LipEdge::Pair* added = proto.add_pairs();
    added->set_upper(pair.upper);
    added->set_lower(pair.lower);
  }
  proto.set_sealed(sealed);
  return proto;
}

LipEdge ToLipEdge(const v1::LipEdge& proto) {
  LipEdge edge{.up = ToVector(proto.up()), .pairs = {}};
  for (const v1::LipEdge::Pair& pair : proto.pairs()) {
    edge.pairs.push_back({.upper = pair.upper(), .lower = pair.lower()});
  }
  return edge;
}

v1::SealSummary ToProto(const SealAnswer& seal) {
  v1::SealSummary proto;
  proto.set_pair_count(static_cast<int32_t>(seal.pairs));
  proto.set_parted_mm(seal.parted_mm);
  proto.set_release_mm(kSealReleaseMm);
  proto.set_released(seal.released);
  return proto;
}

SealAnswer ToSealAnswer(const v1::SealSummary& proto) {
  return {
      .pairs = proto.pair_count(), .parted_mm = proto.parted_mm(), .released = proto.released()};
}

v1::ContactSummary ToProto(const ContactSummary& summary) {
  v1::ContactSummary proto;
  proto.set_row_count(static_cast<int32_t>(summary.rows));
  proto.set_pressing_row_count(static_cast<int32_t>(summary.pressing_rows));
  if (summary.max_force_n) proto.set_max_force_n(*summary.max_force_n);
  proto.set_residual_mm(summary.residual_mm);
  return proto;
}

ContactSummary ToContactSummary(const v1::ContactSummary& proto) {
  ContactSummary summary{.rows = proto.row_count(),
                         .pressing_rows = proto.pressing_row_count(),
                         .max_force_n = std::nullopt,
                         .residual_mm = proto.residual_mm()};
  if (proto.has_max_force_n()) summary.max_force_n = proto.max_force_n();
  return summary;
}

}  // namespace tissueform
