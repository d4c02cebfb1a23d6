// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <chrono>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "absl/strings/string_view.h"
#include "grpcpp/client_context.h"
#include "grpcpp/support/byte_buffer.h"
#include "grpcpp/support/client_callback.h"
#include "grpcpp/support/status.h"

#include "client/gateway/http_server.h"
#include "client/gateway/upstream_pool.h"

namespace tissueform {

// What a call is made with; checked by who made it.
struct CallStart {
  std::string method;                                // "/tissueform.v1.MeshService/GetMesh"
  std::map<std::string, std::string> metadata = {};  // what gRPC takes, names in lower case
  std::optional<std::chrono::nanoseconds> timeout = std::nullopt;
  bool tells_begin = false;  // of a socket: the server's headers go to the client before all else
  bool wants_heartbeat = false;  // of a socket: the gateway is never silent for long
};

// How a call ended.
struct CallEnd {
  grpc::Status status;  // with the details
  std::map<std::string, std::string> trailers = {};
};

// Who makes it; called on the strand.
class UpstreamUser {
 public:
  virtual ~UpstreamUser() = default;
  // Once, before all others: what the server says at its first message or earlier (AllowedMetadata;
  // none where the call ends without that). Read only from then on.
  virtual void OnBegun(std::map<std::string, std::string> headers) = 0;
  // The message that Read asked for.
  virtual void OnAnswer(const grpc::ByteBuffer& message) = 0;
  // What was written is on its way (or lost: the end reports it).
  virtual void OnWritten() = 0;
  // The last that is called.
  virtual void OnEnd(CallEnd end) = 0;
};

// One call of a server, of any kind; its messages stay opaque. All methods on the strand.
class UpstreamCall final : public std::enable_shared_from_this<UpstreamCall>,
                           private grpc::ClientBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer> {
 public:
  static std::shared_ptr<UpstreamCall> Begin(CallSlot slot, const CallStart& start,
                                             std::shared_ptr<ConnectionStrand> strand,
                                             std::shared_ptr<UpstreamUser> user);

  // One at a time; OnAnswer or OnEnd follows.
  void Read();
  // One at a time; OnWritten follows.
  void Write(const std::string& message);
  // Nothing more is written.
  void HalfClose();
  // Cancels the call unless it has ended; nothing is called any more.
  void Cancel();

 private:
  UpstreamCall(CallSlot slot, std::shared_ptr<ConnectionStrand> strand,
               std::shared_ptr<UpstreamUser> user);

  // gRPC's threads; they hand on to the strand.
  void OnReadInitialMetadataDone(bool ok) override;
  void OnReadDone(bool ok) override;
  void OnWriteDone(bool ok) override;
  void OnDone(const grpc::Status& status) override;
  // gRPC shall call OnDone when nothing is under way any more. The strand's.
  void Release();

  // Constant.
  const CallSlot slot_;
  const std::shared_ptr<ConnectionStrand> strand_;
  // The strand's.
  std::shared_ptr<UpstreamUser> user_;
  bool released_ = false;
  // Stored before gRPC knows the call and loaded by its threads: ThreadSanitizer does not see what
  // gRPC itself orders.
  std::atomic<bool> begun_ = false;
  // gRPC's while a read or a write is under way, otherwise the strand's.
  grpc::ClientContext context_;
  grpc::ByteBuffer read_;
  grpc::ByteBuffer written_;
  // Itself, until OnDone.
  std::shared_ptr<UpstreamCall> self_;
};

}  // namespace tissueform
