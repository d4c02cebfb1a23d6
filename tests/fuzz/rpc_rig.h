// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <optional>
#include <string>

#include "google/protobuf/message.h"
#include "grpcpp/support/byte_buffer.h"
#include "grpcpp/support/status.h"

#include "server/rpc/deform_service.h"
#include "server/session/deadline_timer.h"
#include "server/session/session_registry.h"
#include "tests/testing/fake_calls.h"
#include "tests/testing/fake_clock.h"
#include "tests/testing/in_memory_stores.h"
#include "tests/testing/no_logins.h"
#include "tissueform/v1/deform_service.pb.h"

namespace tissueform::fuzz {

// DeformService without sockets, with one session "sessions/fuzzed" of a small bar.
struct RpcRig {
  RpcRig();

  ServiceLimits limits;
  AdmissionControl gate;
  MemoryBudget budget{64 << 20};
  testing::FakeClock clock;
  MeshCatalog catalog{limits, &budget, nullptr, &clock};
  InMemorySessionStore store;
  WorkerPool workers{2};
  SessionRegistry registry{limits, &budget, &workers, &store, &catalog, &clock};
  DeformStreams streams{limits.max_streams};
  SessionWatches watches{limits, &workers};
  DeadlineTimer timer;
  testing::NoLogins no_logins;
  DeformService service{&gate, limits, &no_logins.access, &registry, &streams, &watches, &timer};
  WorkerPool reactions{2};
};

// End the program unless ...
// ... the call has ended, with a code that DeformService documents and a reason that is published.
void CheckEnd(const std::optional<grpc::Status>& status);
// ... every number of the message is finite.
void CheckFinite(const google::protobuf::Message& message);
// ... the positions are finite numbers of whole vertices.
void CheckPositions(const std::string& bytes, v1::PositionEncoding encoding);

}  // namespace tissueform::fuzz
