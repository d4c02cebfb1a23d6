// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/access_rows.h"

#include "absl/strings/str_cat.h"

#include "server/store/store_errors.h"
#include "tissueform/store/v1/store_records.pb.h"

namespace tissueform {
namespace {

template <typename Message>
absl::Status ParseInto(absl::string_view bytes, Message* message) {
  if (message->ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) {
    return absl::OkStatus();
  }
  return Damaged("an access right", "it is unreadable");
}

}  // namespace

std::string KeyOf(const ShareRow& row) {
  return absl::StrCat(row.owner, "\n", row.resource, "\n", row.principal);
}
std::string KeyOf(const FollowLinkRow& row) { return row.digest; }
std::string KeyOf(const MeshRight& row) { return absl::StrCat(row.principal, "\n", row.sha256); }

std::string SerializeRow(const ShareRow& row) {
  store::v1::Share proto;
  proto.set_resource(row.resource);
  proto.set_owner(row.owner);
  proto.set_principal(row.principal);
  proto.set_role(static_cast<int32_t>(row.role));
  return proto.SerializeAsString();
}

std::string SerializeRow(const FollowLinkRow& row) {
  store::v1::FollowLink proto;
  proto.set_digest(row.digest);
  proto.set_session(row.session);
  proto.set_maker(row.maker);
  proto.set_case_sha256(row.case_sha256);
  proto.set_expires_s(row.expires_s);
  return proto.SerializeAsString();
}

std::string SerializeRow(const MeshRight& row) {
  store::v1::MeshRight proto;
  proto.set_principal(row.principal);
  proto.set_sha256(row.sha256);
  proto.set_bytes(row.bytes);
  return proto.SerializeAsString();
}

absl::Status ParseRow(absl::string_view bytes, ShareRow* row) {
  store::v1::Share proto;
  if (const absl::Status status = ParseInto(bytes, &proto); !status.ok()) return status;
  if (proto.role() != static_cast<int32_t>(ShareRole::kViewer) &&
      proto.role() != static_cast<int32_t>(ShareRole::kPlanner)) {
    return Damaged("a share", "its role is unknown");
  }
  *row = {.resource = proto.resource(),
          .owner = proto.owner(),
          .principal = proto.principal(),
          .role = static_cast<ShareRole>(proto.role())};
  return absl::OkStatus();
}

absl::Status ParseRow(absl::string_view bytes, FollowLinkRow* row) {
  store::v1::FollowLink proto;
  if (const absl::Status status = ParseInto(bytes, &proto); !status.ok()) return status;
  *row = {.digest = proto.digest(),
          .session = proto.session(),
          .maker = proto.maker(),
          .case_sha256 = proto.case_sha256(),
          .expires_s = proto.expires_s()};
  return absl::OkStatus();
}

absl::Status ParseRow(absl::string_view bytes, MeshRight* row) {
  store::v1::MeshRight proto;
  if (const absl::Status status = ParseInto(bytes, &proto); !status.ok()) return status;
  *row = {.principal = proto.principal(), .sha256 = proto.sha256(), .bytes = proto.bytes()};
  return absl::OkStatus();
}

}  // namespace tissueform
