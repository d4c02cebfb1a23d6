// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "grpcpp/client_context.h"
#include "grpcpp/support/sync_stream.h"
#include "gtest/gtest.h"

#include "server/app/tissueform_server.h"
#include "tests/integration/access_calls.h"
#include "tests/integration/service_test.h"
#include "tests/server/store/postgres_store/frozen_proxy.h"

namespace tissueform::testing {

// Short, so that a test that waits for a lease to end does not wait long.
inline constexpr std::chrono::milliseconds kTestLease{2'000};

// A server of the cluster, and how it is called.
struct TestNode {
  std::unique_ptr<TissueformServer> server;
  std::unique_ptr<Stubs> stubs;
};

// Of "ann", unless another is named.
std::unique_ptr<grpc::ClientContext> As(const std::string& caller = "ann");

// A drag, to the letter: no client that knows better.
class RawDrag {
 public:
  RawDrag(const TestNode& node, const std::string& session, const std::string& caller = "ann");
  ~RawDrag();
  RawDrag(const RawDrag&) = delete;
  RawDrag& operator=(const RawDrag&) = delete;

  // False when the stream has ended.
  bool Send(uint64_t sequence, bool commit = false);
  // The next frame of this sequence or a later one; acknowledges all.
  std::optional<v1::DeformFrame> ReceiveFrame(uint64_t sequence);
  // Until the poses of this sequence are kept. False when the stream has ended.
  bool WaitForCommit(uint64_t sequence);
  // What the next commit that is reported failed with; empty where it did not.
  std::string NextCommitsFailure();
  // How it has ended; reads what is left.
  absl::Status Finish();

 private:
  bool Read(v1::DeformResponse* response);

  std::unique_ptr<grpc::ClientContext> context_;
  std::unique_ptr<grpc::ClientReaderWriter<v1::DeformRequest, v1::DeformResponse>> stream_;
  bool finished_ = false;
};

// Two servers "a" and "b" on one empty database; callers are who they say they are (NamedCallers).
class ClusterTest : public ::testing::Test {
 protected:
  void SetUp() override;

  static ServerOptions NodeOptions(const std::string& name);
  TestNode StartNode(const ServerOptions& options);

  // Of "ann", made on a node; the bar of the seed.
  std::string MakeSession(const TestNode& node, uint32_t seed, const std::string& id = "");
  static absl::StatusOr<v1::DeformOnceResponse> AskOnce(const TestNode& node,
                                                        const std::string& session, int pose);
  // In the database.
  static int64_t EpochOf(const std::string& session);

  NamedCallers callers_;
  TestNode a_;
  TestNode b_;
};

}  // namespace tissueform::testing
