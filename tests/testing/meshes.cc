// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/testing/meshes.h"

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <random>
#include <utility>

#include "core/mesh/bar_mesh.h"
#include "core/mesh/io/tet_mesh_io.h"
#include "tests/testing/test_paths.h"

namespace tissueform::testing {
namespace {

[[noreturn]] void Die(const std::string& what) {
  std::fprintf(stderr, "test set-up failed: %s\n", what.c_str());
  std::abort();
}

template <typename T>
T ValueOrDie(absl::StatusOr<T> status_or) {
  if (!status_or.ok()) {
    Die(status_or.status().ToString());
  }
  return *std::move(status_or);
}

}  // namespace

TetMesh SingleTet() {
  Positions positions(4, 3);
  positions << 0.1, 0.2, -0.3, 2.1, 0.4, 0.1, 0.3, 1.7, 0.2, 0.5, 0.6, 2.3;
  TetIndices tets(1, 4);
  tets << 0, 1, 2, 3;
  return ValueOrDie(TetMesh::Create(positions, tets));
}

TetMesh Bar(const std::array<int, 3>& cells, double cell_mm, double jitter, uint32_t seed) {
  const TetMesh even = ValueOrDie(BarMesh(CubeGrid(cells, 1.0)));
  std::mt19937 generator(seed);
  // Not std::uniform_real_distribution, whose numbers differ between standard libraries.
  const auto noise = [&] { return jitter * (2.0 * generator() / 4294967295.0 - 1.0); };
  Positions positions = even.positions();
  for (double& coordinate : positions.reshaped<Eigen::RowMajor>()) {
    coordinate = cell_mm * (coordinate + noise());
  }
  return ValueOrDie(TetMesh::Create(std::move(positions), even.tets()));
}

std::vector<int32_t> SelectVertices(const TetMesh& mesh,
                                    const std::function<bool(const Eigen::Vector3d&)>& inside) {
  std::vector<int32_t> selected;
  for (int32_t v = 0; v < mesh.num_vertices(); ++v) {
    if (inside(mesh.positions().row(v).transpose())) {
      selected.push_back(v);
    }
  }
  return selected;
}

ConstraintSet BarEnds(const TetMesh& bar, double depth_mm) {
  const double low = bar.positions().col(2).minCoeff() + depth_mm;
  const double high = bar.positions().col(2).maxCoeff() - depth_mm;
  return ValueOrDie(ConstraintSet::Create(
      bar, SelectVertices(bar, [=](const Eigen::Vector3d& v) { return v.z() <= low; }),
      {{"top", SelectVertices(bar, [=](const Eigen::Vector3d& v) { return v.z() >= high; })}}));
}

TetMesh LoadTestMesh(const std::string& path_under_test_data) {
  return ValueOrDie(ReadTetMesh(TestDataPath(path_under_test_data))).mesh;
}

std::string TestDataPath(const std::string& path_under_test_data) {
  return SourcePath("tests/data/" + path_under_test_data);
}

std::string SharedDataPath(const std::string& path) {
  const char* folder = std::getenv("TISSUEFORM_SHARED_DATA");
  const std::string full = (folder != nullptr ? folder : SourcePath("../shared/data")) + "/" + path;
  return std::filesystem::exists(full) ? full : "";
}

}  // namespace tissueform::testing
