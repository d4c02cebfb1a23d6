// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "grpcpp/client_context.h"
#include "grpcpp/support/sync_stream.h"

#include "client/cpp/session_routes.h"
#include "client/cpp/token_file.h"
#include "core/base/mutex.h"
#include "proto/conversion/geometry_conversion.h"
#include "tissueform/v1/deform_service.grpc.pb.h"

namespace tissueform {

// A drag: poses up, frames down. Made by TissueformClient::OpenStream, which must outlive it.
//
// One thread may receive while others send and acknowledge. Every frame must be acknowledged, or
// the server stops after max_unacked of them; a receiver that only wants the newest one
// acknowledges as it reads.
class DeformStream {
 public:
  struct Options {
    AnswerVertices vertices;
    std::optional<int> max_unacked;  // the server's default when left out
    v1::DeformationModel model = v1::DEFORMATION_MODEL_UNSPECIFIED;  // the session's own
    std::optional<v1::PreparedAnswers> prepared;  // left out: every frame is solved directly
    // DecodePositions of geometry_conversion.h reads the frames.
    v1::PositionEncoding encoding = v1::POSITION_ENCODING_FLOAT32;
    // Called by Receive and Finish with what the server says besides frames.
    std::function<void(const v1::DeformNotice&)> on_notice;
  };

  // What a stream with these options asks for, without its session.
  static v1::DeformConfiguration ConfigurationOf(const Options& options);

  // Cancels the stream unless Finish was called.
  ~DeformStream();

  // What the server said when the stream began: number of vertices a frame, and which.
  const v1::DeformStarted& started() const { return started_; }

  // The server of a cluster that answers; empty: it is of none.
  const std::string& node() const { return node_; }

  // `sequence` must rise from call to call. With `commit` the server keeps the poses, and a notice
  // says when it has. An error means that the stream has ended; Finish says why.
  absl::Status SendPoses(uint64_t sequence, absl::Span<const NamedPose> poses, bool commit = false);
  absl::Status Ack(const v1::DeformFrame& frame);
  // All frames of that sequence.
  absl::Status Ack(uint64_t sequence);
  // No more poses will come: the server answers the newest one and ends the stream. Acks are no
  // longer needed.
  void CloseSending();

  // Blocks until the next frame. Empty when the stream has ended; Finish says how. One thread.
  std::optional<v1::DeformFrame> Receive();

  // The server has said that it is about to end. Any thread.
  bool server_is_draining() const { return server_is_draining_; }

  // Ends the stream at once. Any thread, any time.
  void Cancel();

  // Receives and drops what is still to come and returns how the stream ended. Call it once, after
  // CloseSending or Cancel, when no other thread uses the stream.
  absl::Status Finish();

 private:
  friend class TissueformClient;
  using Call = grpc::ClientReaderWriter<v1::DeformRequest, v1::DeformResponse>;

  DeformStream(SessionRoutes* routes, std::string session)
      : routes_(routes), session_(std::move(session)) {}

  // Sends the configuration and waits for the answer. `token`: where the calls of the client have
  // theirs from; null: they have none. A new one is sent while the stream lasts.
  absl::Status Start(v1::DeformService::Stub* stub, const Options& options,
                     const std::shared_ptr<TokenFile>& token);
  absl::Status Send(const v1::DeformRequest& request) ABSL_LOCKS_EXCLUDED(send_mutex_);

  SessionRoutes* const routes_;
  const std::string session_;

  // Self-synchronised.
  grpc::ClientContext context_;
  std::atomic<bool> server_is_draining_ = false;
  std::atomic<bool> was_cancelled_ = false;

  void HandleNotice(const v1::DeformNotice& notice);

  // Constant after Start.
  std::function<void(const v1::DeformNotice&)> on_notice_;
  v1::DeformStarted started_;
  std::string node_;
  std::unique_ptr<Call> call_;

  Mutex send_mutex_;
  bool sending_closed_ ABSL_GUARDED_BY(send_mutex_) = false;
  bool finished_ = false;
  std::unique_ptr<TokenRenewal> renewal_;  // null without a token; ends before all others
};

}  // namespace tissueform
