// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <string>
#include <thread>
#include <vector>

#include "core/mesh/io/tet_mesh_io.h"
#include "core/mesh/io/triangle_mesh_io.h"
#include "tests/core/mesh/io/mesh_folder.h"
#include "tests/testing/busy_threads.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using testing::BusyThreads;
using testing::IsOk;
using testing::MeshFolder;
using testing::TestDataPath;

using ThreadedReadTest = MeshFolder;

TEST_F(ThreadedReadTest, AllFormatsMayBeReadAtOnceWhileOtherThreadsAllocate) {
  Write("surface.ply",
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty double x\nproperty double y\n"
        "property double z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
        "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
  const BusyThreads busy(3);
  std::vector<std::thread> readers;
  for (const char* name : {"legacy_ascii.vtk", "legacy_binary.vtk", "gmsh41_ascii.msh",
                           "gmsh22_binary.msh", "medit.mesh", "tetgen.ele"}) {
    readers.emplace_back([name] {
      for (int i = 0; i < 3; ++i) {
        const auto file = ReadTetMesh(TestDataPath(std::string("meshes/two_tets/") + name));
        ASSERT_THAT(file, IsOk()) << name;
        EXPECT_EQ(file->mesh.num_tets(), 2) << name;
      }
    });
  }
  for (int t = 0; t < 2; ++t) {
    readers.emplace_back([this] {
      for (int i = 0; i < 3; ++i) {
        const auto file = ReadTriangleMesh(Path("surface.ply"));
        ASSERT_THAT(file, IsOk());
        EXPECT_EQ(file->mesh.num_triangles(), 1);
      }
    });
  }
  for (std::thread& reader : readers) reader.join();
}

}  // namespace
}  // namespace tissueform
