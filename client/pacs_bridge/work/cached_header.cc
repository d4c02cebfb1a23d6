// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/work/cached_header.h"

#include <cstdint>
#include <ctime>
#include <filesystem>
#include <system_error>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "absl/time/time.h"

#include "client/pacs_bridge/dicom/instance_header.h"
#include "core/base/status_macros.h"
#include "server/platform/storage/durable_file.h"

namespace tissueform {
namespace {

// A PACS writes a name with or without the components and groups at its end that are empty.
std::string WithoutEmptyEnd(absl::string_view name) {
  const auto strip = [](absl::string_view text, absl::string_view empty) {
    const size_t last = text.find_last_not_of(empty);
    return text.substr(0, last == absl::string_view::npos ? 0 : last + 1);
  };
  std::vector<absl::string_view> groups = absl::StrSplit(name, '=');
  for (absl::string_view& group : groups) group = strip(group, "^ ");
  return std::string(strip(absl::StrJoin(groups, "="), "="));
}

// The patient that the PACS's query names: `kept` itself if both are the same.
absl::StatusOr<PatientIdentity> AskWhoseItIs(PacsClient* pacs, const std::string& study_uid,
                                             const PatientIdentity& kept) {
  absl::StatusOr<PatientSummary> found = pacs->FindPatient(study_uid);
  if (absl::IsUnimplemented(found.status())) return kept;
  if (absl::IsNotFound(found.status())) return SeriesIsGone();
  if (!found.ok()) return Refused(found.status());
  PatientIdentity now = {
      .id = found->id.substr(0, kMaxIdentityBytes),
      .issuer = found->issuer.empty() ? kept.issuer : found->issuer.substr(0, kMaxIdentityBytes),
      .name = found->name.substr(0, kMaxIdentityBytes),
      .birth_date = found->birth_date.empty() ? kept.birth_date
                                              : found->birth_date.substr(0, kMaxIdentityBytes),
      .readable = found->readable};
  const bool same = now.readable && now.id == kept.id && now.issuer == kept.issuer &&
                    WithoutEmptyEnd(now.name) == WithoutEmptyEnd(kept.name) &&
                    now.birth_date == kept.birth_date;
  return same ? kept : now;
}

}  // namespace

absl::Status SeriesIsGone() {
  return absl::FailedPreconditionError(
      "the PACS no longer has the series of this case; nothing is stored");
}

absl::Status Refused(const absl::Status& status) {
  return absl::IsFailedPrecondition(status) ? absl::UnavailableError(status.message()) : status;
}

absl::StatusOr<PatientIdentity> PatientIn(const std::string& path, const QueuedSeries& series) {
  TF_ASSIGN_OR_RETURN(const InstanceHeader header, ReadInstanceHeader(path));
  if (header.study_uid != series.study_uid || header.series_uid != series.uid) {
    return absl::FailedPreconditionError("the PACS returned a header of another series");
  }
  return IdentityOf(header);
}

absl::StatusOr<FoundPatient> TakeKeptHeader(PacsClient* pacs, const CachedHeader& known,
                                            const std::string& path) {
  const QueuedSeries& series = known.series;
  const int64_t age_s = std::time(nullptr) - series.first_s;
  if (!series.has_header || age_s > known.lifetime.count()) {
    return absl::FailedPreconditionError(
        "the PACS returns no header, and none is kept; allow C-GET there, or send "
        "the series again");
  }
  FoundPatient found;
  TF_ASSIGN_OR_RETURN(const PatientIdentity kept, PatientIn(known.kept, series));
  TF_ASSIGN_OR_RETURN(found.patient, AskWhoseItIs(pacs, series.study_uid, kept));
  if (!(found.patient == kept)) {
    found.has_header = false;
    found.remark = "the PACS returns no header, and the kept one names another patient";
    return found;
  }
  std::error_code failed;
  std::filesystem::copy_file(known.kept, path, failed);
  if (failed) return FileError(failed.value(), "cannot copy the header to", path);
  found.remark = absl::StrCat(
      "stored with the header that was received on ",
      absl::FormatTime("%Y-%m-%d", absl::FromUnixSeconds(series.first_s), absl::UTCTimeZone()),
      ": the PACS returns none");
  return found;
}

}  // namespace tissueform
