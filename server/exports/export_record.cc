// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/exports/export_record.h"

#include "absl/strings/str_cat.h"

#include "core/base/error_reason.h"
#include "server/store/store_errors.h"
#include "tissueform/store/v1/store_records.pb.h"

namespace tissueform {

std::string SerializeExport(const ExportRecord& record) {
  store::v1::ExportRecord proto;
  proto.set_id(record.id);
  proto.set_prediction(record.prediction);
  proto.set_case_sha256(record.case_sha256);
  proto.set_owner(record.owner);
  proto.set_state(static_cast<int32_t>(record.state));
  proto.set_detail(record.detail);
  proto.set_stored_objects(record.stored_objects);
  proto.set_created_s(record.created_s);
  proto.set_updated_s(record.updated_s);
  proto.set_version(record.version);
  proto.set_request_key(record.request_key);
  proto.set_request_fingerprint(record.request_fingerprint);
  proto.set_measures(record.measures);
  proto.set_change(record.change);
  return proto.SerializeAsString();
}

absl::StatusOr<ExportRecord> ParseExport(absl::string_view bytes) {
  store::v1::ExportRecord proto;
  if (!proto.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) {
    return Damaged("an export", "it is unreadable");
  }
  if (proto.state() < static_cast<int32_t>(ExportState::kWaiting) ||
      proto.state() > static_cast<int32_t>(ExportState::kFailed)) {
    return Damaged("an export", "its state is missing");
  }
  return ExportRecord{.id = proto.id(),
                      .prediction = proto.prediction(),
                      .case_sha256 = proto.case_sha256(),
                      .owner = proto.owner(),
                      .state = static_cast<ExportState>(proto.state()),
                      .detail = proto.detail(),
                      .stored_objects = proto.stored_objects(),
                      .created_s = proto.created_s(),
                      .updated_s = proto.updated_s(),
                      .version = proto.version(),
                      .request_key = proto.request_key(),
                      .request_fingerprint = proto.request_fingerprint(),
                      .measures = proto.measures(),
                      .change = proto.change()};
}

bool MayFollow(ExportState before, ExportState after) {
  const bool seen_anew = before == ExportState::kStoring && after == ExportState::kConfirmation;
  return before == after || seen_anew || (!IsDone(before) && after > before);
}

absl::Status StaleExport(absl::string_view id) {
  return WithReason(
      absl::AbortedError(absl::StrCat("export \"", id, "\" has changed; get it and try again")),
      ErrorReason::kStaleEtag);
}

absl::Status NoExport(absl::string_view id) {
  return WithReason(absl::NotFoundError(absl::StrCat("no export \"", id, "\"")),
                    ErrorReason::kExportNotFound);
}

}  // namespace tissueform
