// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "grpcpp/channel.h"
#include "grpcpp/client_context.h"

#include "client/cpp/mesh_upload.h"
#include "client/cpp/session_routes.h"
#include "tissueform/v1/case_service.grpc.pb.h"

namespace tissueform {

// The cases of a server: the rpcs of CaseService. Got from TissueformClient, whose contract it
// shares: calls block, each with a deadline, and errors carry the server's code, message and
// reason. A case is uninterpreted bytes here.
//
// Thread-safe.
class CaseCalls {
 public:
  CaseCalls(const std::shared_ptr<grpc::Channel>& channel, std::chrono::milliseconds call_deadline,
            SessionRoutes* routes);

  // Sends the case unless the server has it. An interrupted upload starts again (on_resumed is not
  // called), also after a restart of the server, until options.give_up_after has passed.
  // `project`: Case.project.
  absl::StatusOr<v1::Case> Upload(absl::string_view bytes, const std::string& title,
                                  const UploadOptions& options = {},
                                  const std::string& project = "");
  absl::StatusOr<v1::Case> Get(const std::string& name);
  // All of them, page after page.
  absl::StatusOr<std::vector<v1::Case>> List();
  absl::Status Delete(const std::string& name);

  // The whole file. Goes on where the connection broke off as long as something comes, in a cluster
  // also before the first byte. Errors: DataLoss also when the bytes are not those that the name
  // says.
  absl::StatusOr<std::string> Read(const std::string& name);

 private:
  absl::StatusOr<v1::Case> TryUpload(absl::string_view bytes, const v1::CaseHeader& header,
                                     const UploadOptions& options);
  // One attempt.
  absl::StatusOr<v1::Case> Find(const std::string& name);
  // Adds what comes from the end of `bytes` on. `follows`: nothing is missing in between; without
  // that the call is given up, and ends well.
  grpc::Status ReadOn(const std::string& name, std::string* bytes, bool* follows,
                      grpc::ClientContext* context);
  std::chrono::system_clock::time_point Deadline() const;

  const std::chrono::milliseconds call_deadline_;
  SessionRoutes* const routes_;
  const std::unique_ptr<v1::CaseService::Stub> stub_;
};

}  // namespace tissueform
