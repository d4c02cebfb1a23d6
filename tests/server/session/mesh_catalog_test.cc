// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/mesh_catalog.h"

#include <chrono>
#include <limits>
#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/fake_clock.h"
#include "tests/testing/meshes.h"
#include "tests/testing/session_samples.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using ::tissueform::testing::Bar;
using ::tissueform::testing::FakeClock;
using ::tissueform::testing::IsOk;
using ::tissueform::testing::SampleMesh;
using ::tissueform::testing::StatusIs;
using ::tissueform::testing::Store;

constexpr int64_t kBudgetBytes = 64 << 20;

class MeshCatalogTest : public ::testing::Test {
 protected:
  absl::Status AdmitAs(const UploadAnnouncement& announcement, const std::string& payload) {
    if (absl::Status status = catalog_.Check(announcement); !status.ok()) return status;
    return catalog_
        .Admit(announcement,
               [&] {
                 MeshPayload read(announcement.shape);
                 read.Write(0, payload);
                 return read;
               })
        .status();
  }

  const SampleMesh sample_{Bar({2, 2, 3}, 1.0, 0.2)};
  ServiceLimits limits_;
  MemoryBudget budget_{kBudgetBytes};
  MeshCatalog catalog_{limits_, &budget_};
};

TEST_F(MeshCatalogTest, AMeshComesOutAsItWentIn) {
  const auto stored = Store(sample_, &catalog_);
  EXPECT_EQ(stored->mesh.positions(), sample_.mesh.positions());
  EXPECT_EQ(stored->mesh.tets(), sample_.mesh.tets());
  ASSERT_NE(stored->FindCellArray("youngs_modulus_pa"), nullptr);
  EXPECT_EQ(stored->FindCellArray("youngs_modulus_pa")->values, sample_.cell_arrays[0].values);
  EXPECT_EQ(stored->FindCellArray("other"), nullptr);
}

TEST_F(MeshCatalogTest, TheSameMeshTwiceIsKeptOnce) {
  const auto first = Store(sample_, &catalog_);
  const int64_t reserved = budget_.reserved_bytes();
  const auto second = Store(sample_, &catalog_);
  EXPECT_EQ(first, second);
  EXPECT_EQ(budget_.reserved_bytes(), reserved);
}

TEST_F(MeshCatalogTest, ARemovedMeshLivesAsLongAsItsUsers) {
  auto stored = Store(sample_, &catalog_);
  EXPECT_THAT(catalog_.Remove(stored->sha256), IsOk());
  EXPECT_EQ(catalog_.Find(stored->sha256), nullptr);
  EXPECT_GT(budget_.reserved_bytes(), 0);
  stored.reset();
  EXPECT_EQ(budget_.reserved_bytes(), 0);
}

TEST_F(MeshCatalogTest, OnlyUnusedMeshesPastTheTtlAreIdle) {
  MeshCatalog catalog(limits_, &budget_);
  auto stored = Store(sample_, &catalog);
  EXPECT_EQ(catalog.RemoveIdle(std::chrono::seconds(0)), 0);
  stored.reset();
  EXPECT_EQ(catalog.RemoveIdle(std::chrono::seconds(0)), 1);
  EXPECT_EQ(budget_.reserved_bytes(), 0);

  Store(sample_, &catalog_);  // TTL of half an hour
  EXPECT_EQ(catalog_.RemoveIdle(limits_.session_idle_ttl), 0);
}

TEST_F(MeshCatalogTest, AMeshIsIdleFromTheEndOfItsTtlAndNotBefore) {
  FakeClock clock;
  MeshCatalog catalog(limits_, &budget_, nullptr, &clock);
  const std::string sha256 = Store(sample_, &catalog)->sha256;
  constexpr std::chrono::nanoseconds kTick{1};
  clock.Advance(limits_.session_idle_ttl - kTick);
  EXPECT_EQ(catalog.RemoveIdle(limits_.session_idle_ttl), 0) << "just before";
  EXPECT_NE(catalog.Find(sha256), nullptr) << "and asking for it begins its time again";
  clock.Advance(limits_.session_idle_ttl - kTick);
  EXPECT_EQ(catalog.RemoveIdle(limits_.session_idle_ttl), 0);
  clock.Advance(kTick);
  EXPECT_EQ(catalog.RemoveIdle(limits_.session_idle_ttl), 1) << "just after";
  EXPECT_EQ(catalog.Find(sha256), nullptr);
}

TEST_F(MeshCatalogTest, AnotherNameOfAnArrayMakesAnotherMesh) {
  SampleMesh renamed = sample_;
  renamed.cell_arrays[0].name = "density";
  EXPECT_NE(renamed.Announcement().sha256, sample_.Announcement().sha256);
}

TEST_F(MeshCatalogTest, WrongDigestIsDataLossAndLeavesNothing) {
  UploadAnnouncement announcement = sample_.Announcement();
  announcement.sha256[0] = announcement.sha256[0] == '0' ? '1' : '0';
  EXPECT_THAT(AdmitAs(announcement, sample_.Payload()),
              StatusIs(absl::StatusCode::kDataLoss, HasSubstr("SHA-256")));
  EXPECT_EQ(budget_.reserved_bytes(), 0);
}

TEST_F(MeshCatalogTest, RefusesInvalidAnnouncements) {
  const auto refused = [this](auto change, absl::StatusCode code, const char* text) {
    UploadAnnouncement announcement = sample_.Announcement();
    change(announcement);
    EXPECT_THAT(catalog_.Check(announcement), StatusIs(code, HasSubstr(text)));
  };
  using Code = absl::StatusCode;
  refused([](auto& a) { a.shape.num_vertices = 0; }, Code::kInvalidArgument, "vertex_count");
  refused([](auto& a) { a.shape.num_tets = -1; }, Code::kInvalidArgument, "tet_count");
  refused([](auto& a) { a.shape.num_vertices = std::numeric_limits<int64_t>::max(); },
          Code::kResourceExhausted, "--max-vertices");
  refused([](auto& a) { a.shape.num_tets = std::numeric_limits<int64_t>::max(); },
          Code::kResourceExhausted, "--max-tets");
  refused([](auto& a) { ++a.total_bytes; }, Code::kInvalidArgument, "total_bytes");
  refused([](auto& a) { a.sha256 = "abc"; }, Code::kInvalidArgument, "sha256");
  refused([](auto& a) { a.sha256[3] = 'G'; }, Code::kInvalidArgument, "sha256");
  refused([](auto& a) { a.shape.cell_arrays = {"a", "a"}; }, Code::kInvalidArgument, "twice");
  refused([](auto& a) { a.shape.cell_arrays = {""}; }, Code::kInvalidArgument, "0 bytes");
  refused([](auto& a) { a.shape.cell_arrays = {std::string(129, 'x')}; }, Code::kInvalidArgument,
          "129 bytes");
  refused([](auto& a) { a.shape.cell_arrays.resize(17); }, Code::kInvalidArgument, "17");
  EXPECT_EQ(budget_.reserved_bytes(), 0);
}

TEST_F(MeshCatalogTest, AMeshOverTheSizeLimitIsRefused) {
  ServiceLimits small;
  small.max_mesh_bytes = sample_.Announcement().total_bytes - 1;
  MeshCatalog catalog(small, &budget_);
  EXPECT_THAT(catalog.Check(sample_.Announcement()),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("--max-mesh-mib")));
}

TEST_F(MeshCatalogTest, MemoryIsReservedBeforeTheMeshIsRead) {
  MemoryBudget tiny(sample_.Announcement().total_bytes - 1);
  MeshCatalog catalog(limits_, &tiny);
  EXPECT_THAT(catalog.Admit(sample_.Announcement(),
                            []() -> absl::StatusOr<MeshPayload> {
                              ADD_FAILURE() << "read without room";
                              return absl::InternalError("");
                            }),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("mesh")));
  const auto reserved_while_it_reads = [this]() -> absl::StatusOr<MeshPayload> {
    EXPECT_GE(budget_.reserved_bytes(), sample_.Announcement().total_bytes);
    return absl::UnavailableError("the disk sleeps");
  };
  EXPECT_THAT(catalog_.Admit(sample_.Announcement(), reserved_while_it_reads),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("sleeps")));
  EXPECT_EQ(budget_.reserved_bytes(), 0);
}

TEST_F(MeshCatalogTest, MeshesThatNoDeformerCanUseAreRefused) {
  const auto refused = [this](auto change, const char* text) {
    SampleMesh broken = sample_;
    Positions positions = broken.mesh.positions();
    TetIndices tets = broken.mesh.tets();
    change(positions, tets, broken.cell_arrays[0].values);
    // Create refuses vertices that do not exist; such bytes are made by hand.
    const MeshPayloadView view = ViewMeshPayload(positions, tets, broken.cell_arrays);
    std::string payload;
    for (const absl::string_view segment : view.segments) {
      payload.append(segment.data(), segment.size());
    }
    EXPECT_THAT(AdmitAs({view.shape, view.shape.TotalBytes(), view.Sha256()}, payload),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(text)));
    EXPECT_EQ(budget_.reserved_bytes(), 0);
  };
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  refused([](auto& positions, auto&, auto&) { positions(3, 1) = kNan; }, "vertex 3");
  refused([](auto& positions, auto&, auto&) { positions(0, 0) = kInfinity; }, "vertex 0");
  refused([](auto&, auto& tets, auto&) { std::swap(tets(5, 0), tets(5, 1)); }, "tet 5");
  refused([](auto&, auto& tets, auto&) { tets(4, 0) = tets(4, 1); }, "tet 4");
  refused([](auto&, auto& tets, auto&) { tets(2, 3) = 10'000; }, "tet 2");
  refused([](auto&, auto& tets, auto&) { tets(2, 3) = -1; }, "tet 2");
  refused([](auto&, auto&, auto& values) { values[7] = kNan; }, "tet 7");
}

}  // namespace
}  // namespace tissueform
