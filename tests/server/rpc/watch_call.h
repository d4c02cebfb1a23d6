// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "grpcpp/impl/codegen/proto_utils.h"
#include "gtest/gtest.h"

#include "server/rpc/deform_service.h"
#include "server/rpc/watch_stream.h"
#include "tests/testing/fake_calls.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {

inline v1::WatchResponse Parse(const grpc::ByteBuffer& bytes) {
  grpc::ByteBuffer copy = bytes;
  v1::WatchResponse response;
  EXPECT_TRUE(grpc::SerializationTraits<v1::WatchResponse>::Deserialize(&copy, &response).ok());
  return response;
}

inline grpc::ByteBuffer Request(const std::string& session, std::optional<int> max_unacked = {}) {
  v1::WatchRequest request;
  request.set_session(session);
  if (max_unacked.has_value()) request.set_max_unacked(*max_unacked);
  const grpc::Slice slice(request.SerializeAsString());
  return {&slice, 1};
}

// One Watch call and what it has said.
class WatchCall {
 public:
  WatchCall(WorkerPool* reactions, DeformService* service, const std::string& session,
            std::optional<int> max_unacked = {})
      : request_(Request(session, max_unacked)), call_(reactions) {
    call_.Bind(service->Watch(nullptr, &request_));
  }

  // Empty when the watch has ended.
  std::optional<v1::WatchResponse> Receive() {
    std::optional<grpc::ByteBuffer> bytes = call_.Receive();
    if (!bytes.has_value()) return std::nullopt;
    last_ = *bytes;
    return Parse(last_);
  }
  // Where the last message lies.
  std::uintptr_t LastBytes() const {
    grpc::Slice slice;
    EXPECT_TRUE(last_.TrySingleSlice(&slice).ok());
    return reinterpret_cast<std::uintptr_t>(slice.begin());
  }
  // The name without its collection. Reads `started` and the first frame.
  std::string Begin(v1::WatchOrigin origin) {
    const auto started = Receive();
    EXPECT_TRUE(started.has_value() && started->has_started());
    if (!started.has_value()) return "";
    const auto frame = Receive();
    EXPECT_TRUE(frame.has_value() && frame->frame().origin() == origin);
    first_ = frame.value_or(v1::WatchResponse()).frame();
    const auto id = ParseWatchName(started->started().watch());
    EXPECT_THAT(id, IsOk());
    return id.value_or("");
  }
  const v1::WatchFrame& first() const { return first_; }
  bool HasUnread() const { return call_.HasUnread(); }
  void Cancel() { call_.Cancel(); }
  std::optional<grpc::Status> WaitUntilDone() { return call_.WaitUntilDone(); }

 private:
  const grpc::ByteBuffer request_;
  FakeWriterCall<grpc::ByteBuffer> call_;
  grpc::ByteBuffer last_;
  v1::WatchFrame first_;
};

}  // namespace tissueform::testing
