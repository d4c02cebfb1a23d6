// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/readers/mesh_reader_call.h"

#include <filesystem>
#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/core/mesh/readers/reader_samples.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using tissueform::testing::IsOk;
using tissueform::testing::StatusIs;

using ::tissueform::testing::kInvalid;

absl::StatusOr<RawMesh> Call(const std::string& wish, const IsolationLimits& limits = {}) {
  return CallMeshReader("mesh_reader_test_helper", {wish, MeshFormat::kPly, 1}, limits);
}

TEST(MeshReaderCallTest, MeshArrivesAsItWasSent) {
  const RawMesh sent = testing::TriangleWithArrays();
  ASSERT_OK_AND_ASSIGN(const RawMesh arrived, Call("with arrays"));
  EXPECT_EQ(arrived.positions, sent.positions);
  EXPECT_EQ(arrived.cells, sent.cells);
  EXPECT_EQ(arrived.split_polygons, 7);
  EXPECT_EQ(arrived.left_out_cells, 9);
  ASSERT_EQ(arrived.point_data.size(), 3U);
  ASSERT_EQ(arrived.cell_data.size(), 2U);
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(arrived.point_data[i].name, sent.point_data[i].name);
    EXPECT_EQ(arrived.point_data[i].components, sent.point_data[i].components);
    EXPECT_TRUE(arrived.point_data[i].values == sent.point_data[i].values);
  }
}

TEST(MeshReaderCallTest, MeshLargerThanAPipeHoldsArrives) {
  const RawMesh sent = testing::LargerThanAPipe();
  ASSERT_OK_AND_ASSIGN(const RawMesh arrived, Call("large"));
  EXPECT_EQ(arrived.positions, sent.positions);
  EXPECT_EQ(arrived.cells, sent.cells);
}

TEST(MeshReaderCallTest, ErrorArrivesAsItIs) {
  EXPECT_THAT(Call("fail"), StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("why")));
}

TEST(MeshReaderCallTest, LibraryThatEndsTheProgramEndsOnlyTheHelper) {
  EXPECT_THAT(Call("abort"), StatusIs(kInvalid, HasSubstr("crashed")));
  EXPECT_THAT(Call("leave"), StatusIs(kInvalid, HasSubstr("crashed")));
  EXPECT_THAT(Call("crash"), StatusIs(kInvalid, HasSubstr("crashed while reading it")));
}

TEST(MeshReaderCallTest, ThrownExceptionsBecomeErrors) {
  EXPECT_THAT(Call("throw an exception"), StatusIs(kInvalid, HasSubstr("odd")));
  EXPECT_THAT(Call("throw a number"), StatusIs(kInvalid, HasSubstr("gave up")));
}

TEST(MeshReaderCallTest, EndlessLoopIsStopped) {
  IsolationLimits limits;
  limits.max_seconds = 1;
  EXPECT_THAT(Call("loop", limits),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("1 seconds")));
}

TEST(MeshReaderCallTest, MoreMemoryThanTheLimitIsRefused) {
  IsolationLimits limits;
  limits.max_memory_bytes = 64 << 20;
  EXPECT_THAT(Call("more memory than allowed", limits),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("memory")));
}

// Also where the helper itself may hold it, as under AddressSanitizer.
TEST(MeshReaderCallTest, MeshLargerThanTheLimitIsNotTakenOver) {
  IsolationLimits limits;
  limits.max_memory_bytes = 32 << 20;
  EXPECT_THAT(Call("a large mesh", limits),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("memory")));
}

TEST(MeshReaderCallTest, LibraryCannotPrintOrWriteFiles) {
  const auto path = std::filesystem::path(::testing::TempDir()) / "mesh_reader_call_test.file";
  std::filesystem::remove(path);
  ::testing::internal::CaptureStdout();
  ::testing::internal::CaptureStderr();
  EXPECT_THAT(Call(path.string()), IsOk());
  EXPECT_THAT(::testing::internal::GetCapturedStdout(), IsEmpty());
  EXPECT_THAT(::testing::internal::GetCapturedStderr(), IsEmpty());
  EXPECT_EQ(std::filesystem::file_size(path), 0U);
  std::filesystem::remove(path);
}

}  // namespace
}  // namespace tissueform
