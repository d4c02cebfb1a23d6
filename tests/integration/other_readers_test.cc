// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <array>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <variant>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <sys/wait.h>

#include "client/cli/session/server_process.h"
#include "core/mesh/io/tet_mesh_io.h"
#include "core/mesh/io/triangle_mesh_io.h"
#include "tests/testing/meshes.h"
#include "tests/testing/run_tissueform.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"

// What each command leaves, opened by VTK's Python module and by meshio.
namespace tissueform::testing {
namespace {

namespace fs = std::filesystem;

const std::string kCheck = SourcePath("tests/integration/open_with_others.py");
constexpr int kModulesMissing = 77;

// What numpy calls the number types, in the order of Attribute::Values.
constexpr std::array<const char*, 10> kNumpyTypes = {"i1", "u1", "i2", "u2", "i4",
                                                     "u4", "i8", "u8", "f4", "f8"};
static_assert(std::variant_size_v<Attribute::Values> == kNumpyTypes.size());

void Dump(const std::string& section, const Attribute& attribute, std::ostream& stream) {
  std::visit(
      [&](const auto& values) {
        stream << section << " " << kNumpyTypes[attribute.values.index()] << " "
               << attribute.components << " " << values.size() << " " << attribute.name << "\n";
        stream.write(reinterpret_cast<const char*>(values.data()),
                     static_cast<std::streamsize>(values.size() * sizeof(values[0])));
      },
      attribute.values);
}

template <typename File, typename Cells>
void DumpMesh(const File& file, const Cells& cells, std::ostream& stream) {
  const Positions& p = file.mesh.positions();
  Dump("points", {"-", 3, std::vector<double>(p.data(), p.data() + p.size())}, stream);
  Dump("cells",
       {"-", static_cast<int>(cells.cols()),
        std::vector<int32_t>(cells.data(), cells.data() + cells.size())},
       stream);
  for (const Attribute& attribute : file.point_data) Dump("point_data", attribute, stream);
  for (const Attribute& attribute : file.cell_data) Dump("cell_data", attribute, stream);
}

void DumpWhatWeRead(const std::string& path, const std::string& to) {
  std::ofstream stream(to, std::ios::binary);
  if (NamesSurface(path)) {
    ASSERT_OK_AND_ASSIGN(const TriangleMeshFile file, ReadTriangleMesh(path));
    DumpMesh(file, file.mesh.triangles(), stream);
  } else {
    ASSERT_OK_AND_ASSIGN(const TetMeshFile file, ReadTetMesh(path));
    DumpMesh(file, file.mesh.tets(), stream);
  }
}

int ExitCodeOf(const std::string& command) { return WEXITSTATUS(std::system(command.c_str())); }

class OtherReadersTest : public CliTest {
 protected:
  void SetUp() override {
    CliTest::SetUp();
    WriteBar();
    const int exit_code = Open("", "");
    if (exit_code == kModulesMissing) {
      GTEST_SKIP() << "python3-meshio or python3-vtk9 is missing: deploy/packages.txt lists them";
    }
    ASSERT_EQ(exit_code, 0) << Read("others.txt");
  }

  void ExpectOthersReadTheSame(const std::string& path) const {
    SCOPED_TRACE(path);
    DumpWhatWeRead(path, Path("ours"));
    EXPECT_EQ(Open(path, Path("ours")), 0) << Read("others.txt");
  }

 private:
  // Debian's Python, whose packages they are; another one may come first in PATH.
  int Open(const std::string& path, const std::string& ours) const {
    return ExitCodeOf(absl::StrCat(TISSUEFORM_PYTHON, " ", kCheck, " ", path, " ", ours, " > ",
                                   Path("others.txt"), " 2>&1"));
  }
};

TEST_F(OtherReadersTest, BundledMeshes) {
  for (const auto& entry : fs::recursive_directory_iterator(TestDataPath("plans"))) {
    const bool is_tongue = entry.path().filename() == "volumetricTongue.vtu";  // not ours
    if (entry.path().extension() != ".vtu" || is_tongue) continue;
    ExpectOthersReadTheSame(entry.path().string());
  }
}

TEST_F(OtherReadersTest, EveryNumberTypeAndNonFiniteNumbers) {
  ASSERT_OK_AND_ASSIGN(TetMeshFile file, ReadTetMesh(Path("bar.vtu")));
  const auto count = static_cast<size_t>(file.mesh.num_vertices());
  std::vector<Attribute>& data = file.point_data;
  data.push_back({"int8 <\"ä\">", 1, std::vector<int8_t>(count, -8)});
  data.push_back({"uint16", 1, std::vector<uint16_t>(count, 65535)});
  data.push_back({"int64", 2, std::vector<int64_t>(2 * count, INT64_MIN)});
  data.push_back({"uint64", 1, std::vector<uint64_t>(count, UINT64_MAX)});
  data.push_back({"float", 9, std::vector<float>(9 * count, 0.1F)});
  data.push_back({"nan", 3, std::vector<double>(3 * count, std::nan(""))});
  data.push_back({"infinite", 3, std::vector<double>(3 * count, -HUGE_VAL)});
  ASSERT_THAT(WriteTetMesh(Path("types.vtu"), file), IsOk());
  ExpectOthersReadTheSame(Path("types.vtu"));
}

TEST_F(OtherReadersTest, SurfacesInEveryFormat) {
  ASSERT_OK_AND_ASSIGN(
      const TriangleMeshFile box,
      ReadTriangleMesh(TestDataPath("meshes/surf_manifold_tests/boxNotManifold.obj")));
  for (const char* name : {"box.vtp", "box.stl", "box.ply", "box.obj", "box.off"}) {
    ASSERT_THAT(WriteTriangleMesh(Path(name), box), IsOk());
    ExpectOthersReadTheSame(Path(name));
  }
}

TEST_F(OtherReadersTest, MeshGenerate) {
  Write("cube.off",
        "OFF\n8 12 0\n0 0 0\n2 0 0\n0 2 0\n2 2 0\n0 0 2\n2 0 2\n0 2 2\n2 2 2\n3 0 2 1\n3 1 2 3\n3 "
        "4 5 "
        "6\n3 5 7 6\n3 0 1 4\n3 1 5 4\n3 2 6 3\n3 3 6 7\n3 0 4 2\n3 2 4 6\n3 1 3 5\n3 3 7 5\n");
  ASSERT_THAT(Run({"mesh", "generate", "cube.off", "--out", "cube.vtu", "--region", "1,1,1,7",
                   "--defects", "defects.vtp"}),
              Succeeds());
  ExpectOthersReadTheSame(Path("cube.vtu"));
  ExpectOthersReadTheSame(Path("defects.vtp"));
}

TEST_F(OtherReadersTest, DeformAndCompare) {
  const std::string plan = TestDataPath("plans/bar/plan.json");
  ASSERT_THAT(Run({"deform", plan, "--out", "after.vtu"}), Succeeds());
  ExpectOthersReadTheSame(Path("after.vtu"));
  ASSERT_THAT(Run({"compare", "bar.vtu", "after.vtu", "--out", "difference.vtu"}), Succeeds());
  ExpectOthersReadTheSame(Path("difference.vtu"));
  ASSERT_THAT(
      Run({"compare", plan, "--models", "gradient_field,linear_elastic", "--out", "models"}),
      Succeeds());
  ExpectOthersReadTheSame(Path("models/gradient_field.vtu"));
  ExpectOthersReadTheSame(Path("models/linear_elastic.vtu"));
}

TEST_F(OtherReadersTest, RunExportAndDemo) {
  const std::string plan = TestDataPath("plans/tongue/plan.json");
  ASSERT_OK_AND_ASSIGN(const std::unique_ptr<ServerProcess> server,
                       ServerProcess::Start(ProgramPath("tissueform-server"),
                                            {"--in-memory", "--port", "0", "--log-level", "warn"},
                                            std::chrono::seconds(60)));
  ASSERT_THAT(Run({"run", plan, "--server", server->address(), "--out", "run.vtu"}), Succeeds());
  ExpectOthersReadTheSame(Path("run.vtu"));
  const ProcessResult made = Run({"prediction", "create", plan, "--server", server->address()});
  ASSERT_THAT(made, Succeeds());
  const std::string name = made.out.substr(0, made.out.find('\n'));
  for (const char* out : {"kept.vtu", "kept.stl", "kept.ply"}) {
    ASSERT_THAT(Run({"prediction", "export", name, "--server", server->address(), "--plan", plan,
                     "--out", out}),
                Succeeds());
    ExpectOthersReadTheSame(Path(out));
  }
  ASSERT_EQ(ExitCodeOf(absl::StrCat("env -u DISPLAY PATH=/nonexistent ", ProgramPath("tissueform"),
                                    " demo --no-browser --seconds 0.1 --plan ", plan, " --out ",
                                    Path("demo"), " > ", Path("demo.txt"))),
            0);
  for (const auto& entry : fs::directory_iterator(Path("demo"))) {
    const fs::path ending = entry.path().extension();
    if (ending == ".csv" || ending == ".json") continue;
    ExpectOthersReadTheSame(entry.path().string());
  }
}

TEST_F(OtherReadersTest, PlanBuild) {
  // The lower face alone, so coarse that it takes seconds.
  Write("recipe.json",
        R"({"format": "tissueform-recipe", "version": 1, "ct": {"hu_offset": -1024, "axes": "RPI"},
            "spacing_mm": 4, "mesh": {"edge_mm": 8, "fine_edge_mm": 8},
            "region_of_interest": {"above": {"point_mm": [0, 0, -50], "normal": [0, 0, -1]},
                                   "back": {"point_mm": [0, 100, 0], "normal": [0, -1, 0]}},
            "segments": [{"name": "mandible", "osteotomy": "bssro",
                          "pose": {"translation_mm": [0, -4, 0]}}]})");
  ASSERT_THAT(
      Run({"plan", "build", "--ct", TestDataPath("ct/headsq/headsq_quarter.nhdr"), "--recipe",
           "recipe.json", "--out", "head", "--no-pictures", "--accept-defects"}),
      Succeeds());
  ExpectOthersReadTheSame(Path("head/head.vtu"));
  ExpectOthersReadTheSame(Path("head/segments/mandible.stl"));
}

}  // namespace
}  // namespace tissueform::testing
