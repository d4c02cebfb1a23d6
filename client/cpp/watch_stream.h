// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "grpcpp/client_context.h"
#include "grpcpp/support/sync_stream.h"

#include "client/cpp/session_routes.h"
#include "tissueform/v1/deform_service.grpc.pb.h"

namespace tissueform {

// Follows a session that others drag. Made by TissueformClient::Watch, which must outlive it.
//
// One thread receives; Ack and Cancel may be called from others. Frames must be acknowledged, or
// the server sends no more after max_unacked of them; a slow receiver skips frames and slows
// no other client.
class WatchStream {
 public:
  struct Options {
    std::optional<int> max_unacked;  // the server's default when left out
    // Called by Receive and Finish with what the server says besides frames.
    std::function<void(const v1::DeformNotice&)> on_notice;
  };

  // Cancels the watch unless Finish was called.
  ~WatchStream();

  // Which vertices the frame that was last received holds, and how they are encoded
  // (DecodePositions of geometry_conversion.h reads them). Of the receiving thread.
  const v1::WatchForm& form() const { return form_; }
  const std::string& name() const { return name_; }
  // The server of a cluster that answers; empty: it is of none.
  const std::string& node() const { return node_; }

  // Blocks until the next frame; the first one is there at once. Empty when the watch has ended;
  // Finish says how.
  std::optional<v1::WatchFrame> Receive();

  // The frame and all before it were used. Errors: NotFound when the watch has ended.
  absl::Status Ack(const v1::WatchFrame& frame);

  // Ends the watch at once. Any thread, any time.
  void Cancel() {
    was_cancelled_ = true;
    context_.TryCancel();
  }

  // Receives and drops what is still to come and returns how the watch ended. Call it once, when no
  // other thread uses it.
  absl::Status Finish();

 private:
  friend class TissueformClient;

  WatchStream(v1::DeformService::Stub* stub, SessionRoutes* routes, std::string session,
              const Options& options)
      : stub_(stub), routes_(routes), session_(std::move(session)), options_(options) {}

  // Waits for the first message.
  absl::Status Start();

  v1::DeformService::Stub* const stub_;
  SessionRoutes* const routes_;
  const std::string session_;
  const Options options_;
  grpc::ClientContext context_;  // self-synchronised, as the next
  std::atomic<bool> was_cancelled_ = false;
  std::unique_ptr<grpc::ClientReader<v1::WatchResponse>> call_;
  std::string name_;  // constant after Start, as the next
  std::string node_;
  v1::WatchForm form_;
  bool finished_ = false;
};

}  // namespace tissueform
