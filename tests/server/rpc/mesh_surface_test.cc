// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/mesh_surface.h"

#include <cstring>
#include <future>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mesh/payload/sha256.h"
#include "core/mesh/tet_topology.h"
#include "tests/server/rpc/reactors_fixture.h"

namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;
using Code = grpc::StatusCode;

// `count` numbers from byte `offset` on.
template <typename Number>
std::vector<Number> NumbersOf(const std::string& bytes, int64_t offset, int64_t count) {
  std::vector<Number> numbers(static_cast<size_t>(count));
  std::memcpy(numbers.data(), bytes.data() + offset, numbers.size() * sizeof(Number));
  return numbers;
}

class GetSurfaceTest : public ReactorsTest {
 protected:
  // Workers wait until the call is bound, as in BindCreateSession.
  void Bind(FakeWriterCall<v1::GetSurfaceResponse>* call, const v1::GetSurfaceRequest* request) {
    std::promise<void> bound;
    const std::shared_future<void> is_bound = bound.get_future().share();
    for (int worker = 0; worker < kWorkers; ++worker) {
      workers_->Post(Lane::kStore, [is_bound] { is_bound.wait(); });
    }
    call->Bind(mesh_service_.GetSurface(nullptr, request));
    bound.set_value();
  }

  // What comes of the sample; its end in `status_`.
  void Get(const std::vector<std::string>& arrays, const std::string& name = "") {
    v1::GetSurfaceRequest request;
    request.set_name(name.empty() ? absl::StrCat("meshes/", stored_->sha256) : name);
    for (const std::string& array : arrays) request.add_cell_arrays(array);
    FakeWriterCall<v1::GetSurfaceResponse> call(reactions_.get());
    Bind(&call, &request);
    bytes_.clear();
    header_.reset();
    while (const std::optional<v1::GetSurfaceResponse> message = call.Receive()) {
      if (message->has_header()) {
        EXPECT_FALSE(header_.has_value()) << "one header, first";
        header_ = message->header();
      } else {
        EXPECT_EQ(message->chunk().offset(), static_cast<int64_t>(bytes_.size()));
        bytes_ += message->chunk().data();
      }
    }
    status_ = *call.WaitUntilDone();
  }
  std::vector<int32_t> Triangles() const {
    return NumbersOf<int32_t>(bytes_, 16 * header_->vertex_count(), 3 * header_->triangle_count());
  }

  const std::shared_ptr<const StoredMesh> stored_ = Store(sample_, &catalog_);
  std::optional<v1::SurfaceHeader> header_;
  std::string bytes_;
  grpc::Status status_;
};

TEST_F(GetSurfaceTest, ItsVerticesAreTheSkinAtRestAndItsBytesHaveItsHash) {
  Get({});
  ASSERT_TRUE(status_.ok()) << status_.error_message();
  ASSERT_TRUE(header_.has_value());
  EXPECT_EQ(static_cast<int64_t>(bytes_.size()), header_->total_bytes());
  EXPECT_EQ(Sha256Hex({bytes_}), header_->sha256());
  EXPECT_EQ(header_->total_bytes(), 16 * header_->vertex_count() + 12 * header_->triangle_count());
  const auto vertices = NumbersOf<int32_t>(bytes_, 0, header_->vertex_count());
  EXPECT_EQ(vertices, stored_->skin);
  const auto positions =
      NumbersOf<float>(bytes_, 4 * header_->vertex_count(), 3 * header_->vertex_count());
  for (size_t i = 0; i < vertices.size(); ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_EQ(positions[3 * i + axis],
                static_cast<float>(sample_.mesh.positions()(vertices[i], axis)));
    }
  }
}

TEST_F(GetSurfaceTest, ItIsClosedFacesOutwardAndHasTheTopologyOfABall) {
  Get({});
  ASSERT_TRUE(header_.has_value());
  const std::vector<int32_t> triangles = Triangles();
  std::map<std::pair<int32_t, int32_t>, int> edges;  // directed
  double volume_mm3 = 0;
  for (size_t t = 0; t < triangles.size(); t += 3) {
    Eigen::Matrix3d corners;
    for (int k = 0; k < 3; ++k) {
      const int32_t vertex = stored_->skin.at(static_cast<size_t>(triangles[t + k]));
      corners.row(k) = sample_.mesh.positions().row(vertex);
      ++edges[{triangles[t + k], triangles[t + (k + 1) % 3]}];
    }
    volume_mm3 += corners.determinant() / 6;
  }
  for (const auto& [edge, count] : edges) {
    EXPECT_EQ(count, 1);
    EXPECT_EQ(edges.count({edge.second, edge.first}), 1U) << "its neighbour goes the other way";
  }
  const auto num_edges = static_cast<int64_t>(edges.size() / 2);
  EXPECT_EQ(header_->vertex_count() - num_edges + header_->triangle_count(), 2);
  double tets_mm3 = 0;
  for (Eigen::Index t = 0; t < sample_.mesh.num_tets(); ++t) {
    const auto corner = [&](int k) {
      return sample_.mesh.positions().row(sample_.mesh.tets()(t, k)).transpose();
    };
    Eigen::Matrix3d edges_of_tet;
    for (int k = 0; k < 3; ++k) edges_of_tet.col(k) = corner(k + 1) - corner(0);
    tets_mm3 += edges_of_tet.determinant() / 6;
  }
  EXPECT_NEAR(volume_mm3, tets_mm3, 1e-9 * tets_mm3);
}

TEST_F(GetSurfaceTest, RegionsAreThoseOfTheTetsBehind) {
  ASSERT_FALSE(stored_->cell_arrays.empty());
  const std::string& name = stored_->cell_arrays[0].name;
  Get({name, name});
  ASSERT_TRUE(status_.ok()) << status_.error_message();
  const int64_t begin = 16 * header_->vertex_count() + 12 * header_->triangle_count();
  const auto regions = NumbersOf<float>(bytes_, begin, header_->triangle_count());
  EXPECT_EQ(
      NumbersOf<float>(bytes_, begin + 4 * header_->triangle_count(), header_->triangle_count()),
      regions);
  const std::vector<int32_t> tets = TetsBehind(stored_->skin_facets, sample_.mesh);
  for (size_t t = 0; t < regions.size(); ++t) {
    EXPECT_EQ(regions[t], static_cast<float>(stored_->cell_arrays[0].values[tets[t]]));
  }
}

TEST_F(GetSurfaceTest, RefusesUnknownMeshesAndArraysByName) {
  Get({}, "meshes/" + std::string(64, '0'));
  EXPECT_EQ(status_.error_code(), Code::NOT_FOUND);
  Get({}, "cases/" + std::string(64, '0'));
  EXPECT_EQ(status_.error_code(), Code::INVALID_ARGUMENT);
  Get({"no such array"});
  EXPECT_EQ(status_.error_code(), Code::INVALID_ARGUMENT);
  EXPECT_THAT(status_.error_message(), HasSubstr("cell_arrays[0]"));
  Get(std::vector<std::string>(9, stored_->cell_arrays[0].name));
  EXPECT_EQ(status_.error_code(), Code::INVALID_ARGUMENT);
  EXPECT_FALSE(header_.has_value());
}

TEST_F(GetSurfaceTest, ItTakesFromTheBudgetAndGivesBack) {
  const int64_t before = budget_.reserved_bytes();
  Get({});
  ASSERT_TRUE(header_.has_value());
  EXPECT_GE(budget_.most_reserved_bytes(), before + header_->total_bytes());
  EXPECT_EQ(budget_.reserved_bytes(), before);
  const auto filler = budget_.Reserve(budget_.limit_bytes() - before - 10, "test");
  ASSERT_TRUE(filler.ok());
  Get({});
  EXPECT_EQ(status_.error_code(), Code::RESOURCE_EXHAUSTED);
}

TEST_F(GetSurfaceTest, ADrainingServerAndAClientThatLeavesEndIt) {
  v1::GetSurfaceRequest request;
  request.set_name(absl::StrCat("meshes/", stored_->sha256));
  {
    FakeWriterCall<v1::GetSurfaceResponse> call(reactions_.get());
    call.StopReading();
    Bind(&call, &request);
    call.Cancel();
    EXPECT_FALSE(call.WaitUntilDone()->ok());
  }
  gate_.StartDraining();
  Get({});
  EXPECT_EQ(status_.error_code(), Code::UNAVAILABLE);
}

}  // namespace
}  // namespace tissueform::testing
