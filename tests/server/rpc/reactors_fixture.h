// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstring>
#include <future>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gtest/gtest.h"

#include "proto/conversion/session_conversion.h"
#include "server/rpc/deform_service.h"
#include "server/rpc/mesh_service.h"
#include "server/rpc/session_service.h"
#include "server/store/upload_store.h"
#include "tests/testing/fake_calls.h"
#include "tests/testing/fake_clock.h"
#include "tests/testing/in_memory_stores.h"
#include "tests/testing/meshes.h"
#include "tests/testing/no_logins.h"
#include "tests/testing/session_samples.h"

namespace tissueform::testing {

using FakeStream = FakeBidiCall<v1::DeformRequest, v1::DeformResponse>;

inline v1::DeformRequest Configuration(const std::string& session) {
  v1::DeformRequest request;
  request.mutable_configuration()->set_session(session);
  return request;
}

// The pose number `sequence`: its z shift shows which one was answered.
inline v1::DeformRequest Pose(uint64_t sequence) {
  v1::DeformRequest request;
  request.mutable_pose()->set_sequence(sequence);
  v1::HandlePose* pose = request.mutable_pose()->add_poses();
  pose->set_handle("top");
  pose->mutable_translation_mm()->set_z(static_cast<double>(sequence) / 64);
  return request;
}

inline v1::DeformRequest Ack(uint64_t sequence) {
  v1::DeformRequest request;
  request.mutable_ack()->set_sequence(sequence);
  return request;
}

inline constexpr int kWorkers = 2;

// The services without sockets: reactions come from a pool of threads that ThreadSanitizer sees
// through.
class ReactorsTest : public ::testing::Test {
 protected:
  // `sessions`: what the records are kept in; null: a store of its own.
  explicit ReactorsTest(SessionStore* sessions = nullptr, SessionOwnership* ownership = nullptr)
      : sessions_(sessions != nullptr ? sessions : &store_), ownership_(ownership) {}
  ~ReactorsTest() override {
    reactions_.reset();
    workers_.reset();
  }

  std::string MakeSession() {
    v1::CreateSessionRequest request = SessionRequestOf(*Store(sample_, &catalog_));
    v1::Session session;
    FakeUnaryCall call(reactions_.get());
    BindCreateSession(&call, request, &session);
    EXPECT_TRUE(call.WaitUntilDone()->ok());
    return session.name();
  }

  // Workers wait until the call is bound: what happens before that meets at a lock inside gRPC,
  // which ThreadSanitizer does not see.
  void BindCreateSession(FakeUnaryCall* call, const v1::CreateSessionRequest& request,
                         v1::Session* session) {
    std::promise<void> bound;
    const std::shared_future<void> is_bound = bound.get_future().share();
    for (int worker = 0; worker < kWorkers; ++worker) {
      workers_->Post(Lane::kBatch, [is_bound] { is_bound.wait(); });
    }
    call->Bind(session_service_.CreateSession(nullptr, &request, session));
    bound.set_value();
  }

  static v1::CreateSessionRequest SessionRequestOf(const StoredMesh& mesh) {
    const ConstraintSet ends = BarEnds(mesh.mesh);
    v1::CreateSessionRequest request;
    request.set_mesh(absl::StrCat("meshes/", mesh.sha256));
    request.mutable_stiffness()->set_uniform_pa(1000);
    request.mutable_fixed_vertices()->Add(ends.fixed().begin(), ends.fixed().end());
    v1::Handle* handle = request.add_handles();
    handle->set_name("top");
    const std::vector<int32_t>& top = ends.handles()[0].vertices;
    handle->mutable_vertices()->Add(top.begin(), top.end());
    return request;
  }

  // The z coordinate of the last vertex, which belongs to the handle, says which pose was answered.
  void ExpectAnswers(const v1::DeformFrame& frame) const {
    const std::string& bytes = frame.positions();
    ASSERT_EQ(bytes.size(), sample_.mesh.num_vertices() * 12);
    float z = 0;
    std::memcpy(&z, bytes.data() + bytes.size() - sizeof(z), sizeof(z));
    const double rest = sample_.mesh.positions()(sample_.mesh.num_vertices() - 1, 2);
    EXPECT_NEAR(z, rest + static_cast<double>(frame.sequence()) / 64, 1e-5);
  }

  const SampleMesh sample_{Bar({2, 2, 3})};
  ServiceLimits limits_;
  AdmissionControl gate_;
  MemoryBudget budget_{64 << 20};
  MeshCatalog catalog_{limits_, &budget_};
  const std::unique_ptr<UploadStore> upload_store_ = *UploadStore::OpenTemporary();
  MeshUploads uploads_{limits_, &catalog_, upload_store_.get()};
  std::unique_ptr<WorkerPool> workers_ = std::make_unique<WorkerPool>(kWorkers);
  InMemorySessionStore store_;
  SessionStore* const sessions_;
  SessionOwnership* const ownership_;
  FakeClock clock_;
  SessionRegistry registry_{limits_,   &budget_, workers_.get(), sessions_,
                            &catalog_, &clock_,  ownership_};
  DeformStreams streams_{limits_.max_streams};
  SessionWatches watches_{limits_, workers_.get()};
  DeadlineTimer timer_;
  NoLogins no_logins_;
  MeshService mesh_service_{&gate_,    limits_,    &no_logins_.changes, &catalog_,
                            &uploads_, &registry_, workers_.get(),      &timer_};
  SessionService session_service_{&gate_,    limits_,    &no_logins_.access,
                                  &catalog_, &registry_, &clock_};
  DeformService deform_service_{&gate_,    limits_, &no_logins_.access, &registry_, &streams_,
                                &watches_, &timer_};
  std::unique_ptr<WorkerPool> reactions_ = std::make_unique<WorkerPool>(4);
};

}  // namespace tissueform::testing
