// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "grpcpp/channel.h"
#include "grpcpp/client_context.h"
#include "grpcpp/support/sync_stream.h"

#include "client/cpp/session_call.h"
#include "tissueform/v1/export_service.grpc.pb.h"

namespace tissueform {

// Hears of exports. Made by ExportCalls::Watch; lives without it. One thread receives; Cancel may
// be called from others.
class ExportWatchStream {
 public:
  // Cancels the watch unless Finish was called.
  ~ExportWatchStream();

  // Blocks until the next one; one without an export says that all that were there at the beginning
  // have come, and later that the server still is there. Empty when the watch has ended; Finish
  // says how.
  std::optional<v1::WatchExportsResponse> Receive();

  // Ends the watch at once. Any thread, any time.
  void Cancel() {
    was_cancelled_ = true;
    context_.TryCancel();
  }

  // Drops what is still to come and returns how the watch ended. Call it once.
  absl::Status Finish();

 private:
  friend class ExportCalls;

  explicit ExportWatchStream(v1::ExportService::Stub* stub)
      : call_(stub->WatchExports(&context_, {})) {}

  grpc::ClientContext context_;  // self-synchronised, as the next
  std::atomic<bool> was_cancelled_ = false;
  std::unique_ptr<grpc::ClientReader<v1::WatchExportsResponse>> call_;
  bool finished_ = false;
};

// What is to go to the PACS: the rpcs of ExportService. Got from TissueformClient, whose contract
// it shares: calls block, each with a deadline, and errors carry the server's code, message and
// reason.
//
// Thread-safe.
class ExportCalls {
 public:
  ExportCalls(const std::shared_ptr<grpc::Channel>& channel,
              std::chrono::milliseconds call_deadline, SessionRoutes* routes);

  // With a `request_id` the call may be repeated: it gives the same export again, done or not.
  absl::StatusOr<v1::Export> Create(const std::string& prediction,
                                    const std::vector<v1::Measure>& measures = {},
                                    const std::string& request_id = "");
  absl::StatusOr<v1::Export> Get(const std::string& name);
  // All of them, page after page; of one prediction or of one case where they are named.
  absl::StatusOr<std::vector<v1::Export>> List(const std::string& prediction = "",
                                               const std::string& case_name = "");
  // What a bridge has done. Errors: Aborted also when request.etag is not the export's.
  absl::StatusOr<v1::Export> Update(const v1::UpdateExportRequest& request);
  absl::Status Delete(const std::string& name);

  // The watch has no deadline; the first Receive shows whether it is allowed.
  std::unique_ptr<ExportWatchStream> Watch();

 private:
  absl::Status Call(CallRepeat repeat,
                    const std::function<grpc::Status(grpc::ClientContext*)>& attempt);
  std::chrono::system_clock::time_point Deadline() const;

  const std::chrono::milliseconds call_deadline_;
  SessionRoutes* const routes_;
  const std::unique_ptr<v1::ExportService::Stub> stub_;
};

}  // namespace tissueform
