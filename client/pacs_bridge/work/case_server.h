// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "client/cpp/connection_options.h"
#include "core/base/cancellation.h"
#include "core/base/types.h"
#include "core/planning/case_file/case_file.h"
#include "tissueform/v1/export_service.pb.h"
#include "tissueform/v1/plan_build_service.pb.h"
#include "tissueform/v1/prediction_service.pb.h"

namespace tissueform {

// What a server keeps of a prediction, and where its vertices are.
struct ServedPrediction {
  v1::Prediction description = {};
  Positions positions = {};  // #V by 3, LPS, mm
};

// What the bridge asks of a Tissueform server. The server receives nothing that names a patient.
//
// Any thread. Errors carry the server's code and reason.
class CaseServer {
 public:
  virtual ~CaseServer() = default;

  // Gives the server the case and first the mesh in it. What it has already is not sent again, so
  // it may be repeated. Returns "cases/{sha256}".
  virtual absl::StatusOr<std::string> Publish(const std::string& case_bytes,
                                              const std::string& title) = 0;
  virtual absl::StatusOr<std::string> ReadCase(const std::string& name) = 0;
  virtual absl::StatusOr<ServedPrediction> ReadPrediction(const std::string& name) = 0;
  // AskMaterialBand.
  virtual absl::StatusOr<std::vector<double>> ReadBand(const CaseFile& contents,
                                                       const v1::Prediction& prediction) = 0;

  // Leaves a CT (BuildInputFiles::kCt) with a recipe for a person, as often as one likes. Returns
  // "buildDrafts/{id}".
  virtual absl::StatusOr<std::string> SendDraft(const std::string& ct, const std::string& title,
                                                const std::string& recipe_json) = 0;
  virtual absl::StatusOr<std::vector<v1::BuildDraft>> ListDrafts() = 0;
  virtual absl::Status RemoveDraft(const std::string& name) = 0;

  virtual absl::StatusOr<v1::Export> GetExport(const std::string& name) = 0;
  virtual absl::Status UpdateExport(const std::string& name, v1::ExportState state,
                                    const std::string& detail, int stored_objects) = 0;
  // Reports every export that is not done, and each that is asked for or changed, until the
  // connection ends or `cancelled` says so, which is looked at every second.
  virtual absl::Status WatchExports(const std::function<void(const v1::Export&)>& on_export,
                                    const Cancellation& cancelled) = 0;
};

// The one at `address` ("HOST:PORT"). `project`: of cases and drafts there; may be empty. Sends
// nothing yet. Errors: those of TissueformClient::Connect.
absl::StatusOr<std::unique_ptr<CaseServer>> ConnectToCaseServer(const std::string& address,
                                                                const ConnectionOptions& options,
                                                                const std::string& project = "");

}  // namespace tissueform
