// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"

#include "client/pacs_bridge/dicom/dicom_file.h"
#include "client/pacs_bridge/network/pacs_client.h"
#include "client/pacs_bridge/work/case_server.h"
#include "client/pacs_bridge/work/object_writer.h"
#include "core/base/status_macros.h"
#include "core/mesh/payload/sha256.h"
#include "server/exports/export_record.h"
#include "tests/core/planning/case_file/sample_case.h"

// What lies about a bridge, as folders, so that it outlives a process that is killed: a server that
// keeps cases and takes of an export the states that a server takes, a PACS that keeps objects, a
// writer of objects that are headers only.
namespace tissueform::testing {

inline void AppendLine(const std::filesystem::path& file, const std::string& line) {
  std::ofstream(file, std::ios::app) << line << "\n";
}

inline std::vector<std::string> LinesOfFile(const std::filesystem::path& file) {
  std::ifstream stream(file);
  std::vector<std::string> lines;
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

class FolderCaseServer : public CaseServer {
 public:
  explicit FolderCaseServer(std::filesystem::path folder) : folder_(std::move(folder)) {}

  absl::StatusOr<std::string> Publish(const std::string& bytes, const std::string& title) override {
    TF_RETURN_IF_ERROR(away);
    AppendLine(folder_ / "titles", title);
    const std::string name = Sha256Hex({bytes});
    std::ofstream(folder_ / name) << bytes;
    return "cases/" + name;
  }
  absl::StatusOr<std::string> ReadCase(const std::string&) override {
    return absl::NotFoundError("no such case");
  }
  absl::StatusOr<ServedPrediction> ReadPrediction(const std::string& name) override {
    if (predictions_gone) return absl::NotFoundError("no such prediction");
    ServedPrediction prediction;
    prediction.description.set_name(name);
    prediction.description.set_mesh(mesh);
    return prediction;
  }
  absl::StatusOr<std::vector<double>> ReadBand(const CaseFile&, const v1::Prediction&) override {
    return band;
  }
  absl::StatusOr<std::string> SendDraft(const std::string& ct, const std::string& title,
                                        const std::string& recipe_json) override {
    TF_RETURN_IF_ERROR(away);
    v1::BuildDraft draft;
    draft.set_name(absl::StrCat("buildDrafts/", ++num_drafts));
    draft.set_title(title);
    draft.set_recipe_json(recipe_json);
    draft.set_total_bytes(static_cast<int64_t>(ct.size()));
    std::ofstream(folder_ / "ct.mha") << ct;
    drafts.push_back(draft);
    return draft.name();
  }
  absl::StatusOr<std::vector<v1::BuildDraft>> ListDrafts() override {
    TF_RETURN_IF_ERROR(away);
    return drafts;
  }
  absl::Status RemoveDraft(const std::string& name) override {
    TF_RETURN_IF_ERROR(away);
    const auto is_it = [&name](const v1::BuildDraft& draft) { return draft.name() == name; };
    return std::erase_if(drafts, is_it) > 0 ? absl::OkStatus() : absl::NotFoundError("no draft");
  }
  absl::StatusOr<v1::Export> GetExport(const std::string& name) override {
    TF_RETURN_IF_ERROR(away);
    if (taken_back.contains(name)) return absl::NotFoundError("no such export");
    v1::Export found;
    found.set_name(name);
    found.set_state(static_cast<v1::ExportState>(StateOf(name)));
    return found;
  }
  absl::Status UpdateExport(const std::string& name, v1::ExportState state,
                            const std::string& detail, int stored) override {
    TF_RETURN_IF_ERROR(away);
    if (!MayFollow(StateOf(name), static_cast<ExportState>(state))) {
      return absl::InvalidArgumentError("invalid change of state");
    }
    AppendLine(folder_ / "updates",
               absl::StrCat(name, " ", v1::ExportState_Name(state), " ", stored, " ", detail));
    return absl::OkStatus();
  }
  absl::Status WatchExports(const std::function<void(const v1::Export&)>&,
                            const Cancellation&) override {
    return absl::UnimplementedError("not here");
  }

  absl::Status away = {};
  std::vector<v1::BuildDraft> drafts = {};
  int num_drafts = 0;
  bool predictions_gone = false;
  std::set<std::string> taken_back = {};      // exports
  std::string mesh = SampleCase().mesh.name;  // of its predictions
  absl::StatusOr<std::vector<double>> band = std::vector<double>();

 private:
  // By the last update.
  ExportState StateOf(const std::string& name) const {
    v1::ExportState state = v1::EXPORT_STATE_WAITING;
    for (const std::string& line : LinesOfFile(folder_ / "updates")) {
      const std::vector<std::string> words = absl::StrSplit(line, ' ');
      if (words[0] == name) v1::ExportState_Parse(words[1], &state);
    }
    return static_cast<ExportState>(state);
  }

  const std::filesystem::path folder_;
};

class FolderPacs final : public PacsClient {
 public:
  explicit FolderPacs(std::filesystem::path folder) : folder_(std::move(folder)) {}

  absl::StatusOr<std::vector<SeriesSummary>> FindSeries(const SeriesQuery&) override {
    return absl::UnimplementedError("not here");
  }
  absl::StatusOr<FetchCounts> FetchSeries(const std::string&, const std::string&, InstanceFolder*,
                                          InstanceSink*) override {
    return absl::UnimplementedError("not here");
  }
  absl::StatusOr<PatientSummary> FindPatient(const std::string& study) override {
    TF_RETURN_IF_ERROR(away);
    TF_RETURN_IF_ERROR(query_service);
    for (const auto& [uid, file] : headers) {
      TF_ASSIGN_OR_RETURN(const InstanceHeader header, ReadInstanceHeader(file));
      if (header.study_uid != study) continue;
      PatientSummary patient = {.name = header.patient_name + "^^", .id = header.patient_id};
      if (returns_optional_keys) {
        patient.issuer = header.issuer_of_patient_id;
        patient.birth_date = header.birth_date;
      }
      return patient;
    }
    return absl::NotFoundError("the PACS has no such study");
  }
  absl::Status FetchHeader(const std::string&, const std::string& series,
                           const std::string& path) override {
    TF_RETURN_IF_ERROR(away);
    TF_RETURN_IF_ERROR(header_service);
    const auto found = headers.find(series);
    if (found == headers.end()) return absl::NotFoundError("the PACS has no such series");
    return CopyHeaderOnly(found->second, path);
  }
  absl::StatusOr<bool> Has(const std::string&, const std::string&,
                           const std::string& uid) override {
    TF_RETURN_IF_ERROR(away);
    return std::filesystem::exists(folder_ / uid);
  }
  absl::StatusOr<std::vector<StoredObject>> Store(absl::Span<const std::string> paths) override {
    TF_RETURN_IF_ERROR(away);
    std::vector<StoredObject> stored;
    for (const std::string& path : paths) {
      const std::string uid = (*ReadInstanceHeader(path)).instance_uid;
      AppendLine(folder_ / "stores", uid);
      std::filesystem::copy_file(path, folder_ / uid);
      stored.push_back({path, uid, absl::OkStatus()});
    }
    return stored;
  }

  std::map<std::string, std::string> headers = {};  // by series: a file with the header
  absl::Status away = {};
  absl::Status header_service = {};  // C-GET
  absl::Status query_service = {};   // C-FIND, of a study's patient
  bool returns_optional_keys = true;

 private:
  const std::filesystem::path folder_;
};

// Writes each object as the header of the source image under its own UID.
class HeaderWriter : public ObjectWriter {
 public:
  size_t more_bytes = 0;  // of each object

  absl::StatusOr<std::vector<std::string>> KeysOf(const ExportMaterial&) override {
    return std::vector<std::string>{"stl:skin", "stl:bone", "capture", "report", "series:models"};
  }
  absl::Status Draw(const ExportMaterial&, const std::string& folder) override {
    std::filesystem::create_directory(folder);
    return absl::OkStatus();
  }
  absl::StatusOr<std::vector<ExportFile>> Write(const ExportMaterial& material) override;
};

}  // namespace tissueform::testing
