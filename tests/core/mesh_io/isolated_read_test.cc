// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh_io/isolated_read.h"

#include <atomic>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <stdexcept>
#include <string>
#include <unistd.h>
#include <vector>

#include "tests/core/mesh_io/mesh_folder.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using tissueform::testing::IsOk;
using tissueform::testing::MeshFolder;
using tissueform::testing::StatusIs;

constexpr auto kInvalid = absl::StatusCode::kInvalidArgument;

RawMesh OneTriangle() {
  RawMesh mesh;
  mesh.positions.resize(3, 3);
  mesh.positions << 0.1, -2, 1e300, 1e-300, 0, 0, 0, 1, std::numeric_limits<double>::infinity();
  mesh.cells.resize(1, 3);
  mesh.cells << 0, 1, 2;
  return mesh;
}

using IsolatedReadTest = MeshFolder;

TEST_F(IsolatedReadTest, MeshArrivesAsItWasSent) {
  RawMesh sent = OneTriangle();
  sent.point_data = {{"bytes", 1, std::vector<int8_t>{-1, 0, 127}},
                     {"unsigned", 1, std::vector<uint64_t>{0, 1, UINT64_MAX}},
                     {"floats", 2, std::vector<float>{1, 2, 3, 4, 5, 6}}};
  sent.cell_data = {{"doubles", 1, std::vector<double>{0.1}}, {"none", 1, std::vector<int16_t>{}}};
  sent.split_polygons = 7;
  ASSERT_OK_AND_ASSIGN(const RawMesh arrived, ReadIsolated({}, [&] { return sent; }));
  EXPECT_EQ(arrived.positions, sent.positions);
  EXPECT_EQ(arrived.cells, sent.cells);
  EXPECT_EQ(arrived.split_polygons, 7);
  ASSERT_EQ(arrived.point_data.size(), 3U);
  ASSERT_EQ(arrived.cell_data.size(), 2U);
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(arrived.point_data[i].name, sent.point_data[i].name);
    EXPECT_EQ(arrived.point_data[i].components, sent.point_data[i].components);
    EXPECT_TRUE(arrived.point_data[i].values == sent.point_data[i].values);
  }
}

TEST_F(IsolatedReadTest, MeshLargerThanAPipeHoldsArrives) {
  RawMesh sent;
  sent.positions.setRandom(100000, 3);
  sent.cells.setConstant(200000, 4, 5);
  ASSERT_OK_AND_ASSIGN(const RawMesh arrived, ReadIsolated({}, [&] { return sent; }));
  EXPECT_EQ(arrived.positions, sent.positions);
  EXPECT_EQ(arrived.cells, sent.cells);
}

TEST_F(IsolatedReadTest, ErrorArrivesAsItIs) {
  EXPECT_THAT(
      ReadIsolated(
          {}, []() -> absl::StatusOr<RawMesh> { return absl::FailedPreconditionError("why"); }),
      StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("why")));
}

TEST_F(IsolatedReadTest, LibraryThatEndsTheProgramEndsOnlyTheChild) {
  EXPECT_THAT(ReadIsolated({}, []() -> absl::StatusOr<RawMesh> { std::abort(); }),
              StatusIs(kInvalid, HasSubstr("crashed")));
  EXPECT_THAT(ReadIsolated({}, []() -> absl::StatusOr<RawMesh> { _exit(0); }),
              StatusIs(kInvalid, HasSubstr("crashed")));
  EXPECT_THAT(ReadIsolated({},
                           []() -> absl::StatusOr<RawMesh> {
                             raise(SIGSEGV);
                             return OneTriangle();
                           }),
              StatusIs(kInvalid, HasSubstr("crashed")));
}

TEST_F(IsolatedReadTest, WhateverIsThrownIsAnError) {
  EXPECT_THAT(
      ReadIsolated({}, []() -> absl::StatusOr<RawMesh> { throw std::runtime_error("odd"); }),
      StatusIs(kInvalid, HasSubstr("odd")));
  EXPECT_THAT(ReadIsolated({}, []() -> absl::StatusOr<RawMesh> { throw 3; }),
              StatusIs(kInvalid, HasSubstr("gave up")));
}

TEST_F(IsolatedReadTest, EndlessLoopIsStopped) {
  MeshReadLimits limits;
  limits.max_seconds = 1;
  EXPECT_THAT(ReadIsolated(limits,
                           []() -> absl::StatusOr<RawMesh> {
                             for (std::atomic<unsigned> turns = 0;; ++turns) {
                             }
                           }),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("1 seconds")));
}

TEST_F(IsolatedReadTest, MoreMemoryThanTheLimitIsRefused) {
  MeshReadLimits limits;
  limits.max_memory_bytes = 64 << 20;
  const auto read = []() -> absl::StatusOr<RawMesh> {
    RawMesh mesh = OneTriangle();
    mesh.point_data.push_back({"large", 1, std::vector<double>(300'000'000)});
    return mesh;
  };
  EXPECT_THAT(ReadIsolated(limits, read),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("memory")));
}

// Also where the child itself may hold it, as under AddressSanitizer.
TEST_F(IsolatedReadTest, MeshLargerThanTheLimitIsNotTakenOver) {
  MeshReadLimits limits;
  limits.max_memory_bytes = 32 << 20;
  const auto read = []() -> absl::StatusOr<RawMesh> {
    RawMesh mesh = OneTriangle();
    for (const char* name : {"a", "b", "c"}) {
      mesh.point_data.push_back({name, 1, std::vector<double>(1'500'000)});
    }
    return mesh;
  };
  EXPECT_THAT(ReadIsolated(limits, read),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("memory")));
}

TEST_F(IsolatedReadTest, WhatTheLibraryPrintsIsLostAndItCannotWriteFiles) {
  ::testing::internal::CaptureStdout();
  ::testing::internal::CaptureStderr();
  EXPECT_THAT(ReadIsolated({},
                           [this]() -> absl::StatusOr<RawMesh> {
                             std::puts("chatter");
                             std::fputs("chatter", stderr);
                             std::fflush(stdout);
                             Write("file", "contents");
                             return OneTriangle();
                           }),
              IsOk());
  EXPECT_THAT(::testing::internal::GetCapturedStdout(), IsEmpty());
  EXPECT_THAT(::testing::internal::GetCapturedStderr(), IsEmpty());
  EXPECT_THAT(tissueform::testing::Slurp(Path("file")), IsEmpty());
}

}  // namespace
}  // namespace tissueform
