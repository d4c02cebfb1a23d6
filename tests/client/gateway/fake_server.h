// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <memory>
#include <string>

#include "grpcpp/generic/async_generic_service.h"
#include "grpcpp/server.h"

#include "core/base/mutex.h"

namespace tissueform::testing {

// A gRPC server in this process that does by a method's name what a test wants:
//
//   DeformService/Deform, MeshService/GetMesh    sends every message back, ends with OK at the
//                                                half-close; headers and trailers
//                                                x-tissueform-node: its name, and secret: no
//   MeshService/ListMeshes, DeformService/Stuck  never answers; the second never reads, either
//   CaseService/ReadCase, DeformService/Watch    sends messages of kEndlessBytes until it is
//                                                cancelled
//   SessionService/GetSession                    the names of the client's metadata that it saw,
//                                                with their values
//   others                                       what EndWith has said, at first NOT_FOUND, "not
//                                                here: 5 %", with details; with headers and
//                                                trailers
class FakeServer : public grpc::CallbackGenericService {
 public:
  static constexpr size_t kEndlessBytes = size_t{64} << 10;

  explicit FakeServer(std::string name = "fake");
  // Cancels what is open.
  ~FakeServer() override;

  const std::string& name() const { return name_; }
  std::string address() const;
  // By the health service.
  void SetServing(bool serving);
  // How those calls end from now on of which nothing else is said above.
  void EndWith(const grpc::Status& end) ABSL_LOCKS_EXCLUDED(mutex_);
  grpc::Status end() const ABSL_LOCKS_EXCLUDED(mutex_);

  std::atomic<int> open = 0;
  std::atomic<int> cancelled = 0;
  // Messages of the endless calls that gRPC has taken.
  std::atomic<int> written = 0;

 private:
  grpc::ServerGenericBidiReactor* CreateReactor(
      grpc::GenericCallbackServerContext* context) override;

  const std::string name_;
  int port_ = 0;
  mutable Mutex mutex_;
  grpc::Status end_ ABSL_GUARDED_BY(mutex_){grpc::StatusCode::NOT_FOUND, "not here: 5 %",
                                            "details"};
  std::unique_ptr<grpc::Server> server_;
};

}  // namespace tissueform::testing
