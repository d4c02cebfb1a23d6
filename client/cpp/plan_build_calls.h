// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <functional>
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
#include "core/base/cancellation.h"
#include "tissueform/v1/plan_build_service.grpc.pb.h"

namespace tissueform {

// Plans that a server builds from volumes and recipes: the rpcs of PlanBuildService. Got from
// TissueformClient, whose contract it shares: calls block, each with a deadline, and errors carry
// the server's code, message and reason. A file is uninterpreted bytes here; the sender has
// removed what names the patient.
//
// Thread-safe.
class PlanBuildCalls {
 public:
  PlanBuildCalls(const std::shared_ptr<grpc::Channel>& channel,
                 std::chrono::milliseconds call_deadline, SessionRoutes* routes);

  // Sends a file unless the server has it, from where an earlier attempt broke off, of this call or
  // another one. `suffix` is BuildFile.suffix. Tries again as SendMesh does. Errors: Cancelled.
  absl::StatusOr<v1::BuildFile> Upload(absl::string_view bytes, const std::string& suffix,
                                       const UploadOptions& options = {},
                                       const Cancellation& cancellation = {});

  // Without a request_id in the request it is given one: a lost call is found again.
  absl::StatusOr<v1::PlanBuild> Create(v1::CreatePlanBuildRequest request);
  absl::StatusOr<v1::PlanBuild> Get(const std::string& name);
  absl::StatusOr<v1::PlanBuild> Cancel(const std::string& name);
  absl::Status Delete(const std::string& name);

  // Waits until the build is done, however it ended; `on_change` (may be empty) gets each state on
  // this thread. Goes on after the connection broke or the server started again, for up to a minute
  // without an answer. Errors: Cancelled: the build goes on.
  absl::StatusOr<v1::PlanBuild> Wait(const std::string& name,
                                     const std::function<void(const v1::PlanBuild&)>& on_change,
                                     const Cancellation& cancellation = {});

  // Leaves a file of Upload for a person; the same again returns the same draft.
  absl::StatusOr<v1::BuildDraft> CreateDraft(const v1::CreateBuildDraftRequest& request);
  absl::StatusOr<v1::BuildDraft> GetDraft(const std::string& name);
  // All of them, page after page, without their recipes.
  absl::StatusOr<std::vector<v1::BuildDraft>> ListDrafts();
  absl::Status DeleteDraft(const std::string& name);
  // Its CT. Errors: as ReadFile.
  absl::StatusOr<std::string> ReadDraft(const std::string& name,
                                        const Cancellation& cancellation = {});

  // One of PlanBuild.files. Errors: DataLoss also when the chunks are not contiguous or do not make
  // up the whole file.
  absl::StatusOr<std::string> ReadFile(const std::string& name, const std::string& path,
                                       const Cancellation& cancellation = {});

 private:
  using Service = v1::PlanBuildService::StubInterface;
  template <typename Request, typename Answer>
  using UnaryMethod = grpc::Status (Service::*)(grpc::ClientContext*, const Request&, Answer*);

  absl::Status Call(const std::function<grpc::Status(grpc::ClientContext*)>& attempt);
  // One answer to one request, repeated as Call does.
  template <typename Request, typename Answer>
  absl::StatusOr<Answer> Ask(UnaryMethod<Request, Answer> method, const Request& request);
  // One stream; `last` keeps what it showed last. Errors: those of the stream, also where it ended
  // well but before the build.
  absl::Status WatchOnce(const std::string& name,
                         const std::function<void(const v1::PlanBuild&)>& on_change,
                         const Cancellation& cancellation, v1::PlanBuild* last, bool* came);
  std::chrono::system_clock::time_point Deadline() const;

  const std::chrono::milliseconds call_deadline_;
  SessionRoutes* const routes_;
  const std::unique_ptr<v1::PlanBuildService::Stub> stub_;
};

// Whether the build has ended.
bool IsDone(const v1::PlanBuild& build);

}  // namespace tissueform
