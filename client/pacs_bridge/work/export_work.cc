// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/work/export_work.h"

#include <algorithm>
#include <ctime>
#include <filesystem>
#include <system_error>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"

#include "client/pacs_bridge/dicom/dicom_uid.h"
#include "client/pacs_bridge/dicom/instance_header.h"
#include "client/pacs_bridge/queue/draft_rows.h"
#include "client/pacs_bridge/work/plan_work.h"
#include "client/pacs_bridge/work/retry_times.h"
#include "core/base/status_macros.h"
#include "core/planning/case_file/case_reader.h"
#include "server/platform/storage/durable_file.h"
#include "server/platform/storage/fault_points.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

// Of UpdateExportRequest.detail.
constexpr size_t kMaxDetailBytes = 256;
// Once a minute: a PACS may be down for a day.
constexpr int64_t kMaxExportAttempts = 1440;
constexpr char kSeriesKey[] = "series:";

bool IsSeriesKey(const std::string& key) { return absl::StartsWith(key, kSeriesKey); }

std::string DetailOf(const std::string& text) {
  std::string line = text.substr(0, kMaxDetailBytes);
  std::replace_if(
      line.begin(), line.end(), [](unsigned char c) { return c < 0x20 || c >= 0x7F; }, '?');
  return line;
}

bool IsDone(v1::ExportState state) {
  return state == v1::EXPORT_STATE_STORED || state == v1::EXPORT_STATE_FAILED;
}

int CountSent(const std::vector<QueuedObject>& objects) {
  return static_cast<int>(
      std::count_if(objects.begin(), objects.end(), [](const QueuedObject& o) { return o.sent; }));
}

}  // namespace

// A case of a draft may be so new that PlanWork::FollowDrafts has not noted it.
absl::StatusOr<QueuedSeries> ExportWork::SeriesOfCase(const std::string& case_name) {
  absl::StatusOr<QueuedSeries> known = received_.GetByCase(case_name);
  if (!absl::IsNotFound(known.status())) return known;
  DraftRows rows(queue_);
  TF_ASSIGN_OR_RETURN(const std::vector<QueuedDraft> drafts, rows.List());
  if (drafts.empty()) return known;
  TF_ASSIGN_OR_RETURN(const std::vector<v1::BuildDraft> listed, server_->ListDrafts());
  for (const v1::BuildDraft& one : listed) {
    if (std::find(one.cases().begin(), one.cases().end(), case_name) == one.cases().end()) continue;
    const auto draft = std::ranges::find(drafts, one.name(), &QueuedDraft::name);
    if (draft == drafts.end()) continue;
    TF_RETURN_IF_ERROR(rows.AddCase(*draft, case_name));
  }
  return received_.GetByCase(case_name);
}

absl::Status ExportWork::Take(const v1::Export& reported) {
  if (IsDone(reported.state())) return absl::OkStatus();
  const absl::StatusOr<QueuedSeries> series = SeriesOfCase(reported.case_());
  if (absl::IsNotFound(series.status())) {
    if (options_.inform) {
      options_.inform(
          absl::StrCat(reported.name(), " has a case of another bridge and is left to it"));
    }
    return absl::OkStatus();
  }
  TF_RETURN_IF_ERROR(series.status());
  QueuedExport asked;
  asked.name = reported.name();
  asked.key = NewQueueKey();
  asked.prediction = reported.prediction();
  asked.case_name = reported.case_();
  asked.first_s = std::time(nullptr);
  TF_ASSIGN_OR_RETURN(QueuedExport queued, rows_.Add(asked));
  if (reported.state() != v1::EXPORT_STATE_WAITING) return absl::OkStatus();
  // It does not know, or asks again for what has failed.
  if (queued.state == BridgeExportState::kFailed && queued.done_s != 0) {
    queued.state = BridgeExportState::kAsked;
    queued.note.clear();
    queued.last_error.clear();
    queued.first_s = asked.first_s;
    queued.done_s = 0;
    TF_RETURN_IF_ERROR(rows_.Update(queued));
  }
  if (queued.state != BridgeExportState::kAsked) return absl::OkStatus();
  TF_FAULT_POINT("export.asked");
  return server_->UpdateExport(queued.name, v1::EXPORT_STATE_CONFIRMATION,
                               "waits for confirmation on the bridge's review page", 0);
}

absl::StatusOr<bool> ExportWork::IsStillAsked(const QueuedExport& queued) {
  const absl::StatusOr<v1::Export> known = server_->GetExport(queued.name);
  if (known.ok() && !IsDone(known->state())) return true;
  if (!known.ok() && !absl::IsNotFound(known.status())) return known.status();
  std::error_code ignored;
  fs::remove_all(queue_->object_folder(queued.key), ignored);
  TF_RETURN_IF_ERROR(rows_.Remove(queued.name));
  return false;
}

absl::Status ExportWork::RunStep(QueuedExport* queued) {
  switch (queued->state) {
    case BridgeExportState::kConfirmed:
      return Fetch(queued);
    case BridgeExportState::kFetched:
      return Write(queued);
    case BridgeExportState::kWritten:
      return Send(queued);
    case BridgeExportState::kSent:
      return ReportStored(queued);
    case BridgeExportState::kFailed:
      return queued->done_s == 0 ? ReportFailed(queued) : absl::OkStatus();
    case BridgeExportState::kAsked:
    case BridgeExportState::kReported:
      return absl::OkStatus();
  }
  return absl::OkStatus();
}

absl::Status ExportWork::Step(QueuedExport* queued) {
  const BridgeExportState before = queued->state;
  const absl::Status status = RunStep(queued);
  if (status.ok()) {
    queued->attempts = 0;
    queued->last_error.clear();
  } else {
    queued->state = before;
    ++queued->attempts;
    queued->last_error = DetailOf(std::string(status.message()));
    if (!MayCome(status) || queued->attempts >= kMaxExportAttempts) {
      if (before == BridgeExportState::kFailed) {
        queued->done_s = std::time(nullptr);
      } else {
        queued->note = queued->last_error;
      }
      queued->state = BridgeExportState::kFailed;
      queued->attempts = 0;
    }
  }
  TF_FAULT_POINT("export.stepped");
  TF_RETURN_IF_ERROR(rows_.Update(*queued));
  return status;
}

absl::Status ExportWork::Fetch(QueuedExport* queued) {
  TF_ASSIGN_OR_RETURN(const QueuedSeries series, received_.GetByCase(queued->case_name));
  const std::string folder = queue_->object_folder(queued->key);
  TF_RETURN_IF_ERROR(MakeFolder(folder));
  const std::string path = folder + "/header.dcm";
  TF_ASSIGN_OR_RETURN(const FoundPatient found,
                      FetchPatientHeader(pacs_,
                                         {.series = series,
                                          .kept = queue_->header_path(series.key),
                                          .lifetime = options_.header_lifetime},
                                         path));
  TF_FAULT_POINT("export.header");
  if (DigestOf(found.patient) != queued->confirmed) {
    std::error_code ignored;
    fs::remove(path, ignored);  // it may wait for long, and the header is the patient's
    return AskAnew(queued, series.study_uid, found);
  }
  if (!found.has_header) {
    return absl::FailedPreconditionError(absl::StrCat(found.remark, "; allow C-GET there"));
  }
  TF_RETURN_IF_ERROR(
      server_->UpdateExport(queued->name, v1::EXPORT_STATE_STORING, "is being written", 0));
  queued->state = BridgeExportState::kFetched;
  if (!found.remark.empty()) {
    queued->note = found.remark;
    if (options_.warn) options_.warn(absl::StrCat(queued->name, ": ", found.remark));
  }
  return absl::OkStatus();
}

absl::Status ExportWork::AskAnew(QueuedExport* queued, const std::string& study_uid,
                                 const FoundPatient& now) {
  // The server first: its notice of this change must not be compared with what this step writes.
  TF_RETURN_IF_ERROR(server_->UpdateExport(queued->name, v1::EXPORT_STATE_CONFIRMATION,
                                           "the patient's data changed: waits for confirmation",
                                           0));
  TF_FAULT_POINT("export.patient_told");
  TF_ASSIGN_OR_RETURN(const QueuedStudy study, received_.GetStudy(study_uid));
  QueuedExport asked = *queued;
  asked.state = BridgeExportState::kAsked;
  asked.note = WhatHasChanged(study.patient, now.patient);
  if (!now.has_header) absl::StrAppend(&asked.note, "; ", now.remark);
  asked.confirmed.clear();
  asked.first_s = std::time(nullptr);
  TF_RETURN_IF_ERROR(rows_.UpdateWithPatient(asked, study_uid, now.patient));
  *queued = asked;
  return absl::OkStatus();
}

absl::StatusOr<ExportMaterial> ExportWork::Gather(const QueuedExport& queued) {
  TF_ASSIGN_OR_RETURN(const QueuedSeries series, received_.GetByCase(queued.case_name));
  const std::string folder = queue_->object_folder(queued.key);
  TF_RETURN_IF_ERROR(MakeFolder(folder));
  ExportMaterial material;
  material.header = folder + "/header.dcm";
  material.case_path = CasePathOf(*queue_, series.key, queued.case_name);
  std::error_code failed;
  if (!fs::exists(material.case_path, failed)) {
    material.case_path = folder + "/case.tfcase";
    TF_ASSIGN_OR_RETURN(const std::string bytes, server_->ReadCase(queued.case_name));
    TF_RETURN_IF_ERROR(WriteDurably(material.case_path, {bytes}));
  }
  TF_ASSIGN_OR_RETURN(material.case_file, ReadCase(material.case_path));
  TF_ASSIGN_OR_RETURN(material.prediction, server_->ReadPrediction(queued.prediction));
  if (material.prediction.description.mesh() != material.case_file.mesh.name) {
    return absl::FailedPreconditionError(
        "the prediction has a different mesh from its case; predict in the case again, and send "
        "that");
  }
  TF_ASSIGN_OR_RETURN(material.asked, server_->GetExport(queued.name));
  TF_ASSIGN_OR_RETURN(material.sources, received_.ListSources(queued.case_name));
  material.series_uid = series.uid;
  material.pictures = ExportPictures::FolderIn(folder);
  material.folder = folder + "/written";
  return material;
}

absl::Status ExportWork::Draw(const QueuedExport& queued) {
  const std::string folder = queue_->object_folder(queued.key);
  if (ExportPictures::AreThere(folder)) return absl::OkStatus();
  const absl::StatusOr<ExportMaterial> material = Gather(queued);
  const absl::Status status =
      material.ok() ? pictures_.Make(queued, *material).status() : material.status();
  // The export may have ended since then and its folder been removed: do not leave a new one.
  const absl::StatusOr<QueuedExport> now = rows_.Get(queued.name);
  if (now.ok() ? now->done_s != 0 : absl::IsNotFound(now.status())) {
    std::error_code ignored;
    fs::remove_all(folder, ignored);
  }
  return status;
}

absl::Status ExportWork::Write(QueuedExport* queued) {
  TF_ASSIGN_OR_RETURN(ExportMaterial material, Gather(*queued));
  TF_ASSIGN_OR_RETURN(material.band_mm, pictures_.Make(*queued, material));
  TF_ASSIGN_OR_RETURN(const std::vector<std::string> keys, writer_->KeysOf(material));
  TF_ASSIGN_OR_RETURN(const std::vector<QueuedObject> objects,
                      rows_.EnsureObjects(queued->name, keys, NewDicomUid));
  TF_FAULT_POINT("export.uids");
  for (const QueuedObject& object : objects) material.uids[object.key] = object.uid;
  std::error_code ignored;
  fs::remove_all(material.folder, ignored);
  TF_RETURN_IF_ERROR(MakeFolder(material.folder));
  TF_ASSIGN_OR_RETURN(const std::vector<ExportFile> files, writer_->Write(material));
  TF_FAULT_POINT("export.files");
  for (const ExportFile& file : files) {
    TF_RETURN_IF_ERROR(rows_.UpdateObject(
        queued->name, {.key = file.key, .uid = "", .file = file.path, .sent = false}));
  }
  queued->state = BridgeExportState::kWritten;
  return absl::OkStatus();
}

absl::Status ExportWork::SendMissing(const QueuedExport& queued,
                                     std::vector<QueuedObject>* objects) {
  TF_ASSIGN_OR_RETURN(const QueuedSeries series, received_.GetByCase(queued.case_name));
  std::vector<std::string> paths;
  std::vector<QueuedObject*> missing;
  for (QueuedObject& object : *objects) {
    if (object.sent) continue;
    TF_ASSIGN_OR_RETURN(const InstanceHeader header, ReadInstanceHeader(object.file));
    const absl::StatusOr<bool> there = pacs_->Has(series.study_uid, header.series_uid, object.uid);
    // One that cannot be asked gets an object with the same UID again, which it knows by that.
    const bool can_be_asked =
        !absl::IsUnimplemented(there.status()) && !absl::IsFailedPrecondition(there.status());
    if (!there.ok() && can_be_asked) return there.status();
    if (there.ok() && *there) {
      object.sent = true;
      TF_RETURN_IF_ERROR(rows_.UpdateObject(queued.name, object));
    } else {
      paths.push_back(object.file);
      missing.push_back(&object);
    }
  }
  TF_FAULT_POINT("export.sending");
  if (paths.empty()) return absl::OkStatus();
  TF_ASSIGN_OR_RETURN(const std::vector<StoredObject> stored, pacs_->Store(paths));
  TF_FAULT_POINT("export.transferred");
  absl::Status first_error;
  for (size_t i = 0; i < missing.size() && i < stored.size(); ++i) {
    first_error.Update(stored[i].status);
    if (!stored[i].status.ok()) continue;
    missing[i]->sent = true;
    TF_RETURN_IF_ERROR(rows_.UpdateObject(queued.name, *missing[i]));
    TF_FAULT_POINT("export.marked");
  }
  return first_error;
}

absl::Status ExportWork::Send(QueuedExport* queued) {
  TF_ASSIGN_OR_RETURN(std::vector<QueuedObject> objects, rows_.ListObjects(queued->name));
  const auto never_sent = [](const QueuedObject& o) {
    return IsSeriesKey(o.key) || o.file.empty();
  };
  objects.erase(std::remove_if(objects.begin(), objects.end(), never_sent), objects.end());
  TF_RETURN_IF_ERROR(SendMissing(*queued, &objects));
  if (CountSent(objects) != static_cast<int>(objects.size()) || objects.empty()) {
    return absl::UnavailableError("the PACS did not accept all objects");
  }
  queued->state = BridgeExportState::kSent;
  return absl::OkStatus();
}

absl::Status ExportWork::ReportStored(QueuedExport* queued) {
  TF_ASSIGN_OR_RETURN(const std::vector<QueuedObject> objects, rows_.ListObjects(queued->name));
  const absl::Status reply =
      server_->UpdateExport(queued->name, v1::EXPORT_STATE_STORED, "", CountSent(objects));
  // NotFound: the user has taken the export back since then; it is in the PACS nevertheless.
  if (!reply.ok() && !absl::IsNotFound(reply)) return reply;
  TF_FAULT_POINT("export.told");
  std::error_code ignored;
  fs::remove_all(queue_->object_folder(queued->key), ignored);
  queued->state = BridgeExportState::kReported;
  queued->done_s = std::time(nullptr);
  return absl::OkStatus();
}

absl::Status ExportWork::ReportFailed(QueuedExport* queued) {
  const absl::Status reply =
      server_->UpdateExport(queued->name, v1::EXPORT_STATE_FAILED, DetailOf(queued->note), 0);
  if (!reply.ok() && !absl::IsNotFound(reply)) return reply;
  std::error_code ignored;
  fs::remove_all(queue_->object_folder(queued->key), ignored);
  queued->done_s = std::time(nullptr);
  return absl::OkStatus();
}

}  // namespace tissueform
