// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "proto/conversion/mesh_conversion.h"

#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::tissueform::testing::StatusIs;

using ::tissueform::testing::kInvalid;

TEST(MeshConversionTest, NamesAreStrict) {
  const std::string digest(64, 'a');
  EXPECT_EQ(MeshName(digest), "meshes/" + digest);
  ASSERT_OK_AND_ASSIGN(const std::string parsed, ParseMeshName("meshes/" + digest));
  EXPECT_EQ(parsed, digest);
  for (const std::string name : {"", "meshes/", "meshes/abc", "sessions/abc"}) {
    EXPECT_THAT(ParseMeshName(name), StatusIs(kInvalid, HasSubstr("invalid mesh name")));
  }
  EXPECT_THAT(ParseMeshName("meshes/" + std::string(64, 'A')),
              StatusIs(kInvalid, HasSubstr("mesh")));
}

TEST(MeshConversionTest, AHeaderSaysTheShapeAndItsBytes) {
  const MeshPayloadShape shape{.num_vertices = 5, .num_tets = 2, .cell_arrays = {"a", "b"}};
  const v1::MeshHeader header = ToProto(shape, std::string(64, 'c'));
  EXPECT_EQ(header.total_bytes(), 5 * 24 + 2 * 16 + 2 * 2 * 8);
  EXPECT_EQ(header.sha256(), std::string(64, 'c'));
  const MeshPayloadShape back = ToPayloadShape(header);
  EXPECT_EQ(back.num_vertices, 5);
  EXPECT_EQ(back.num_tets, 2);
  EXPECT_THAT(back.cell_arrays, ElementsAre("a", "b"));
}

}  // namespace
}  // namespace tissueform
