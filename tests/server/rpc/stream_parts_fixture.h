// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <utility>

#include "gtest/gtest.h"

#include "server/rpc/stream_answers.h"
#include "server/session/session.h"
#include "tests/testing/fake_clock.h"
#include "tests/testing/meshes.h"
#include "tests/testing/session_samples.h"

namespace tissueform::testing {

// Sessions for the parts of a stream, without registry and without gRPC.
class StreamPartsTest : public ::testing::Test {
 protected:
  // This thread stands for making_strand(), so nothing else may be made at the same time.
  std::shared_ptr<Session> MakeSession(SessionRecord record) {
    record.id = "id";
    std::shared_ptr<SharedPreparation> preparation = preparations_.Find(record);
    auto session = Session::Create(std::move(record), bar_, std::move(preparation), &budget_,
                                   &pool_, &clock_, {});
    EXPECT_TRUE(session.ok()) << session.status();
    return *std::move(session);
  }
  std::shared_ptr<Session> MakeSession() { return MakeSession(BarRecord(*bar_)); }

  static v1::DeformConfiguration Request() {
    v1::DeformConfiguration request;
    request.set_session("sessions/id");
    return request;
  }

  const ServiceLimits limits_ = {};
  FakeClock clock_;
  MemoryBudget budget_{64 << 20};
  MeshCatalog catalog_{{}, &budget_};
  WorkerPool pool_{1};
  SharedPreparations preparations_{&budget_, &pool_};
  const std::shared_ptr<const StoredMesh> bar_ = Store(SampleMesh(Bar({2, 2, 3})), &catalog_);
};

}  // namespace tissueform::testing
