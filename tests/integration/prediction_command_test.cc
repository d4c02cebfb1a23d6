// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "absl/strings/match.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"

#include "core/mesh/io/tet_mesh_io.h"
#include "core/mesh/io/triangle_mesh_io.h"
#include "core/mesh/tet_topology.h"
#include "core/planning/rendering/virtual_display.h"
#include "tests/integration/served_cli_test.h"
#include "tests/testing/run_tissueform.h"
#include "tests/testing/scoped_environment.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"

// `tissueform prediction` as a real program with a real server.
namespace tissueform::testing {
namespace {

using Json = nlohmann::json;
using ::testing::AllOf;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

const std::string kTonguePlan = SourcePath("tests/data/plans/tongue/plan.json");

class PredictionCommandTest : public ServedCliTest {
 protected:
  ProcessResult Prediction(std::vector<std::string> words) const {
    words.insert(words.begin(), "prediction");
    words.insert(words.end(), {"--server", server_->address()});
    return Run(words);
  }
  // Its name is the first line.
  std::string Create(std::vector<std::string> words) const {
    words.insert(words.begin(), {"create", kTonguePlan});
    const ProcessResult result = Prediction(words);
    EXPECT_THAT(result, Succeeds());
    EXPECT_THAT(result.out, StartsWith("predictions/"));
    return result.out.substr(0, result.out.find('\n'));
  }
  // In this process, without a server. It may warn of inverted tets.
  void Deform(const std::string& model, const std::string& out) const {
    EXPECT_EQ(Run({"deform", kTonguePlan, "--model", model, "--out", out}).exit_code, 0);
  }
  Json ReadJson(const std::string& name) const { return Json::parse(Read(name)); }
};

TEST_F(PredictionCommandTest, TitleAndCaseAreKeptAndListed) {
  const std::string digest(64, 'c');
  const std::string titled = Create({"--title", "Chin 8 mm", "--case", digest});
  const std::string plain = Create({});
  const std::string listed = Prediction({"list", "--case", "cases/" + digest}).out;
  EXPECT_THAT(listed, AllOf(HasSubstr(titled), HasSubstr("Chin 8 mm"), Not(HasSubstr(plain))));
  const Json parsed = Json::parse(Prediction({"show", titled, "--json"}).out);
  EXPECT_EQ(parsed["title"], "Chin 8 mm");
  EXPECT_EQ(parsed["case"], "cases/" + digest);
  EXPECT_THAT(Prediction({"list", "--case", "none"}), FailsWith(1, HasSubstr("invalid case name")));
}

TEST_F(PredictionCommandTest, ListsAndWithdrawsASentPrediction) {
  const std::string of_case = Create({"--case", std::string(64, 'c')});
  const ProcessResult sent = Prediction({"send", of_case});
  EXPECT_THAT(sent, Succeeds());
  EXPECT_THAT(sent.out, AllOf(StartsWith("exports/"), HasSubstr("waiting")));
  const std::string name = sent.out.substr(0, sent.out.find(':'));
  EXPECT_THAT(Prediction({"sent", "--prediction", of_case}).out,
              AllOf(HasSubstr(name), HasSubstr(of_case), HasSubstr("\n1 exports\n")));
  EXPECT_THAT(Prediction({"unsend", name}), Succeeds());
  EXPECT_THAT(Prediction({"sent"}).out, HasSubstr("\n0 exports\n"));
  EXPECT_THAT(Prediction({"unsend", name}), FailsWith(1, HasSubstr("no export")));
  EXPECT_THAT(Prediction({"send", Create({})}), FailsWith(1, HasSubstr("has no case")));
}

TEST_F(PredictionCommandTest, ListsShowsComparesAndDeletes) {
  const std::string field = Create({});
  const std::string elastic = Create({"--model", "linear_elastic"});
  EXPECT_THAT(Prediction({"list"}).out,
              AllOf(HasSubstr(field), HasSubstr(elastic), ContainsRegex("\n2 predictions\n")));
  const ProcessResult shown = Prediction({"show", field, "--json"});
  const Json parsed = Json::parse(shown.out);
  EXPECT_EQ(parsed["prediction"], field);
  EXPECT_EQ(parsed["model"], "gradient_field");
  EXPECT_THAT(parsed["notice"], HasSubstr("not a medical device"));
  const std::string id = field.substr(field.find('/') + 1);
  EXPECT_THAT(Prediction({"show", id}).out, HasSubstr(field));

  const ProcessResult compared = Prediction({"compare", field, elastic, "--json"});
  EXPECT_THAT(compared, Succeeds());
  const Json json = Json::parse(compared.out);
  EXPECT_EQ(json["other_model"], "linear_elastic");
  // The same from two results of `deform`.
  Deform("gradient_field", "field.vtu");
  Deform("linear_elastic", "elastic.vtu");
  ASSERT_OK_AND_ASSIGN(const TetMeshFile one, ReadTetMesh(Path("field.vtu")));
  ASSERT_OK_AND_ASSIGN(const TetMeshFile other, ReadTetMesh(Path("elastic.vtu")));
  const Eigen::VectorXd distances =
      (one.mesh.positions() - other.mesh.positions()).rowwise().norm();
  EXPECT_NEAR(json["distances"]["max_mm"], distances.maxCoeff(), 2e-6);  // float32
  EXPECT_NEAR(json["distances"]["mean_mm"], distances.mean(), 2e-6);
  EXPECT_EQ(json["distances"]["vertices"], distances.size());
  EXPECT_THAT(Prediction({"compare", field, elastic}).out, ContainsRegex("\nall +"));
  EXPECT_EQ(json["vertices"], "all");

  const std::vector<int32_t> skin = BoundaryVertices(one.mesh);
  const Eigen::VectorXd of_skin = distances(skin);
  ASSERT_NE(of_skin.mean(), distances.mean());
  const Json on_skin = Json::parse(Prediction({"compare", field, elastic, "--skin", "--json"}).out);
  EXPECT_EQ(on_skin["vertices"], "skin");
  EXPECT_EQ(on_skin["distances"]["vertices"], skin.size());
  EXPECT_NEAR(on_skin["distances"]["mean_mm"], of_skin.mean(), 2e-6);
  Write("list.txt", "7 3\n 11\n");
  const std::vector<std::string> words = {"compare", field, elastic, "--vertices", "list.txt"};
  EXPECT_THAT(Prediction(words).out, ContainsRegex("\nlisted +3 "));
  Write("list.txt", "7 three");
  EXPECT_THAT(Prediction(words), FailsWith(1, HasSubstr("\"three\" is not a vertex")));
  Write("list.txt", " \n");
  EXPECT_THAT(Prediction(words), FailsWith(1, HasSubstr("list.txt: no vertices")));
  Write("list.txt", "7 7");
  EXPECT_THAT(Prediction(words), FailsWith(1, HasSubstr("7")));

  EXPECT_THAT(Prediction({"delete", field}), Succeeds());
  EXPECT_THAT(Prediction({"show", field}), FailsWith(1, HasSubstr("no prediction")));
  EXPECT_THAT(Prediction({"compare", elastic}), FailsWith(1, HasSubstr("--model")));
  EXPECT_THAT(Prediction({"compare", elastic, "--model", "arap"}),
              FailsWith(1, HasSubstr("session")));  // ended with `create`
}

TEST_F(PredictionCommandTest, ExportsAreTheResultWithItsProvenance) {
  const std::string name = Create({"--model", "linear_elastic"});
  for (const std::string out : {"after.vtu", "after.stl", "after.ply", "after.json"}) {
    EXPECT_THAT(Prediction({"export", name, "--plan", kTonguePlan, "--out", out}), Succeeds());
  }
  Deform("linear_elastic", "deform.vtu");
  ASSERT_OK_AND_ASSIGN(const TetMeshFile after, ReadTetMesh(Path("after.vtu")));
  ASSERT_OK_AND_ASSIGN(const TetMeshFile deform, ReadTetMesh(Path("deform.vtu")));
  // Coordinates are below 8 mm: float32 steps there are 4.8e-7 mm.
  EXPECT_LT((after.mesh.positions() - deform.mesh.positions()).cwiseAbs().maxCoeff(), 5e-7);
  EXPECT_EQ(after.cell_data.size(), deform.cell_data.size());
  for (const char* surface : {"after.stl", "after.ply"}) {
    ASSERT_OK_AND_ASSIGN(const TriangleMeshFile skin, ReadTriangleMesh(Path(surface)));
    EXPECT_EQ(skin.mesh.num_triangles(), BoundaryFacets(after.mesh).rows()) << surface;
  }
  const Json provenance = ReadJson("after.vtu.json");
  EXPECT_EQ(provenance["file"], "after.vtu");
  EXPECT_EQ(provenance["prediction"], name);
  EXPECT_EQ(provenance["model"], "linear_elastic");
  EXPECT_EQ(provenance["mesh_sha256"].get<std::string>().size(), 64U);
  EXPECT_GT(provenance["quality"]["max_displacement_mm"], 0);
  EXPECT_FALSE(provenance["poses"].empty());
  EXPECT_THAT(provenance["create_time"], ContainsRegex("^20..-..-..T..:..:..Z$"));
  EXPECT_THAT(provenance["notice"], HasSubstr("not a medical device"));
  const Json whole = ReadJson("after.json");
  ASSERT_EQ(whole["positions_mm"].size(), static_cast<size_t>(after.mesh.num_vertices()));
  EXPECT_EQ(whole["positions_mm"][7][2], after.mesh.positions()(7, 2));
}

TEST_F(PredictionCommandTest, RangesOfThePlanGiveAnExportTheBandThatDeformGives) {
  Json plan = Json::parse(std::ifstream(SourcePath("tests/data/plans/bar/plan.json")));
  plan["version"] = 2;
  plan["mesh"] = SourcePath("tests/data/plans/bar/bar.vtu");
  plan["model"] = "neo_hookean";
  plan["uncertainty"] = {{"youngs_modulus_factor_95", 2}};
  Write("plan.json", plan.dump());
  const ProcessResult created = Prediction({"create", "plan.json", "--allow-outside"});
  ASSERT_THAT(created, Succeeds());
  const std::string name = created.out.substr(0, created.out.find('\n'));
  const std::vector<std::string> exporting = {"export",          name,    "--plan",   "plan.json",
                                              "--allow-outside", "--out", "after.vtu"};
  EXPECT_THAT(Prediction(exporting), Succeeds());
  ASSERT_EQ(Run({"deform", "plan.json", "--allow-outside", "--out", "deform.vtu"}).exit_code, 0);
  constexpr const char* kArray = "material_uncertainty_p95_mm";
  ASSERT_OK_AND_ASSIGN(const TetMeshFile after, ReadTetMesh(Path("after.vtu")));
  ASSERT_OK_AND_ASSIGN(const TetMeshFile deform, ReadTetMesh(Path("deform.vtu")));
  ASSERT_NE(FindAttribute(after.point_data, kArray), nullptr);
  const std::vector<double> band = ToDoubles(*FindAttribute(after.point_data, kArray));
  const std::vector<double> of_deform = ToDoubles(*FindAttribute(deform.point_data, kArray));
  EXPECT_THAT(band, ::testing::Pointwise(::testing::DoubleNear(1e-3), of_deform));  // of float32
  EXPECT_GT(*std::max_element(band.begin(), band.end()), 0.01);
  EXPECT_TRUE(ReadJson("after.vtu.json").contains("material_uncertainty"));

  plan["poisson_ratio"] = 0.4;
  Write("plan.json", plan.dump());
  const ProcessResult changed = Prediction(exporting);
  EXPECT_EQ(changed.exit_code, 0);
  EXPECT_THAT(changed.err, HasSubstr("its material uncertainty is omitted"));
  ASSERT_OK_AND_ASSIGN(const TetMeshFile without, ReadTetMesh(Path("after.vtu")));
  EXPECT_EQ(FindAttribute(without.point_data, kArray), nullptr);
}

TEST_F(PredictionCommandTest, PicturesAreOfItsCaseOrOfItsPlan) {
  if (absl::IsNotFound(VirtualDisplay::Open().status())) GTEST_SKIP() << "no display and no Xvfb";
  // Under AddressSanitizer: Mesa's leaks, see tests/core/planning/rendering/figure_test.cc.
  const ScopedEnvironment no_leak_check("LSAN_OPTIONS", "detect_leaks=0");
  ASSERT_EQ(Run({"case", "pack", kTonguePlan, "--out", "tongue.tfcase"}).exit_code, 0);
  const ProcessResult published =
      Run({"case", "publish", "tongue.tfcase", "--server", server_->address()});
  ASSERT_EQ(published.exit_code, 0) << published.err;
  const size_t at = published.out.find("cases/");
  ASSERT_NE(at, std::string::npos);
  const std::string name = Create({"--case", published.out.substr(at, 6 + 64)});
  EXPECT_THAT(Prediction({"export", name, "--png", "of_case"}), Succeeds());
  EXPECT_THAT(Prediction({"export", name, "--png", "of_plan", "--plan", kTonguePlan, "--out",
                          "after.json"}),
              Succeeds());
  for (const char* picture : {"front.png", "left.png", "three_quarter.png"}) {
    EXPECT_THAT(Read(std::string("of_case/") + picture), StartsWith("\x89PNG")) << picture;
    EXPECT_THAT(Read(std::string("of_plan/") + picture), StartsWith("\x89PNG")) << picture;
  }
  EXPECT_EQ(ReadJson("after.json")["prediction"], name);
}

TEST_F(PredictionCommandTest, PicturesWithoutAnythingToShowAreRefused) {
  if (absl::IsNotFound(VirtualDisplay::Open().status())) GTEST_SKIP() << "no display and no Xvfb";
  const std::string name = Create({});
  EXPECT_THAT(Prediction({"export", name}), FailsWith(1, HasSubstr("--png")));
  EXPECT_THAT(Prediction({"export", name, "--png", "pictures"}),
              FailsWith(1, HasSubstr("has no case to draw")));
  const std::string lost = Create({"--case", std::string(64, 'c')});
  EXPECT_EQ(Prediction({"export", lost, "--png", "pictures"}).exit_code, 1);
  std::filesystem::create_directory(Path("full"));
  Write("full/mine.txt", "mine");
  EXPECT_THAT(Prediction({"export", name, "--png", "full", "--plan", kTonguePlan}),
              FailsWith(1, HasSubstr("full")));
  EXPECT_FALSE(std::filesystem::exists(Path("pictures")));
}

TEST_F(PredictionCommandTest, ExportRefusesAnotherMeshAndWritesNothing) {
  const std::string name = Create({});
  const std::string other = SourcePath("tests/data/plans/head_chin/plan.json");
  EXPECT_THAT(Prediction({"export", name, "--plan", other, "--out", "after.vtu"}),
              FailsWith(1, HasSubstr("is not the mesh from which predictions/")));
  WriteBar();
  EXPECT_THAT(Prediction({"export", name, "--mesh", "bar.vtu", "--out", "after.vtu"}),
              FailsWith(1, HasSubstr("is not the mesh from which predictions/")));
  EXPECT_THAT(Prediction({"export", name, "--out", "after.stl"}),
              FailsWith(1, HasSubstr("--plan")));
  EXPECT_THAT(Prediction({"export", name, "--plan", kTonguePlan, "--out", "after.obj"}),
              FailsWith(1, HasSubstr(".ply")));
  EXPECT_THAT(Prediction({"create"}), FailsWith(1, HasSubstr("--session")));
  for (const std::string& file : Files()) {
    EXPECT_FALSE(absl::StartsWith(file, "after")) << file;
  }
}

}  // namespace
}  // namespace tissueform::testing
