// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <signal.h>
#include <string>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "grpcpp/create_channel.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"
#include <sys/wait.h>

#include "client/cli/session/server_process.h"
#include "client/cpp/plan_session.h"
#include "client/cpp/tissueform_client.h"
#include "core/mesh/io/tet_mesh_io.h"
#include "core/mesh/io/triangle_mesh_io.h"
#include "core/mesh/payload/mesh_payload.h"
#include "core/mesh/skin_region.h"
#include "core/mesh/tet_topology.h"
#include "core/planning/plan_io.h"
#include "core/planning/rendering/virtual_display.h"
#include "proto/conversion/mesh_conversion.h"
#include "tests/integration/served_cli_test.h"
#include "tests/testing/run_tissueform.h"
#include "tests/testing/scoped_environment.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"

// `tissueform run` and `tissueform demo` as real programs with a real server.
namespace tissueform::testing {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using ::testing::AllOf;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

constexpr std::chrono::seconds kPatience{60};
const std::string kTonguePlan = SourcePath("tests/data/plans/tongue/plan.json");
const std::string kChinPlan = SourcePath("tests/data/plans/head_chin/plan.json");

int ExitCodeOf(const std::string& command) { return WEXITSTATUS(std::system(command.c_str())); }

// Of the vertices of that region, from the arrays of a result.
double MeanMovement(const TetMeshFile& result, SkinRegion region) {
  const std::vector<double> regions = ToDoubles(*FindAttribute(result.point_data, "skin_region"));
  const std::vector<double> moves = ToDoubles(*FindAttribute(result.point_data, "displacement_mm"));
  double sum = 0;
  int count = 0;
  for (size_t v = 0; v < regions.size(); ++v) {
    if (regions[v] != static_cast<double>(region)) continue;
    sum += std::hypot(moves[3 * v], moves[3 * v + 1], moves[3 * v + 2]);
    ++count;
  }
  return sum / count;
}

// Commands of a server that runs already.
class ServedCommandTest : public ServedCliTest {
 protected:
  ProcessResult OfServer(std::vector<std::string> words) const {
    words.insert(words.end(), {"--server", server_->address()});
    return Run(words);
  }

  const PlanProblem tongue_ = *ResolvePlan(*ReadPlan(kTonguePlan));
};

// `demo`, which starts a server of its own.
class DemoCommandTest : public CliTest {
 protected:
  // Its results go into the folder, what it says into out.txt there.
  int RunDemo(const std::string& options, const std::string& before = "") const {
    // Under AddressSanitizer: Mesa's leaks, see tests/core/planning/rendering/figure_test.cc.
    const ScopedEnvironment no_leak_check("LSAN_OPTIONS", "detect_leaks=0");
    return ExitCodeOf(before + ProgramPath("tissueform") + " demo --no-browser --out " +
                      folder_.string() + " " + options + " > " + Path("out.txt"));
  }

  Json Summary() const { return Json::parse(Read("summary.json")); }

  // Where there is a display, or Xvfb to make one.
  void ExpectPictures() const {
    if (absl::IsNotFound(VirtualDisplay::Open().status())) return;
    for (const char* name : {"front.png", "left.png", "three_quarter.png"}) {
      EXPECT_THAT(Read(name), StartsWith("\x89PNG")) << name;
      EXPECT_THAT(Read("out.txt"), HasSubstr(name));
    }
  }
};

TEST_F(ServedCommandTest, RunEqualsDeformUpToFloat32) {
  ASSERT_EQ(OfServer({"run", kTonguePlan, "--out", "run.vtu", "--stats", "run.json"}).exit_code, 0);
  ASSERT_EQ(Run({"deform", kTonguePlan, "--out", "deform.vtu"}).exit_code, 0);
  ASSERT_OK_AND_ASSIGN(const TetMeshFile run, ReadTetMesh(Path("run.vtu")));
  ASSERT_OK_AND_ASSIGN(const TetMeshFile deform, ReadTetMesh(Path("deform.vtu")));
  ASSERT_EQ(run.mesh.num_vertices(), deform.mesh.num_vertices());
  // Coordinates are below 8 mm: float32 steps there are 4.8e-7 mm.
  EXPECT_LT((run.mesh.positions() - deform.mesh.positions()).cwiseAbs().maxCoeff(), 5e-7);
  EXPECT_TRUE(fs::exists(Path("run.json")));
}

TEST_F(ServedCommandTest, RunReportsTheReactionsAndTheBandOfDeform) {
  std::ifstream bundled(SourcePath("tests/data/plans/bar/plan.json"));
  Json plan = Json::parse(bundled);
  plan["mesh"] = SourcePath("tests/data/plans/bar/bar.vtu");
  plan["model"] = "neo_hookean";
  plan["version"] = 2;
  plan["uncertainty"]["youngs_modulus_factor_95"] = 2;
  Write("plan.json", plan.dump());
  const std::vector<std::string> rest = {"plan.json", "--allow-outside", "--stats", "stats.json"};
  const auto stats = [&](std::vector<std::string> words) {
    words.insert(words.begin() + 1, rest.begin(), rest.end());
    EXPECT_EQ(Run(words).exit_code, 0);
    return Json::parse(Read("stats.json"));
  };
  const Json of_run = stats({"run", "--out", "run.vtu", "--server", server_->address()});
  const Json of_deform = stats({"deform", "--out", "deform.vtu"});
  const Json& served = of_run.at("elastic");
  const Json& alone = of_deform.at("elastic");
  const auto force = [](const Json& of) {
    const auto numbers = of["handles"][0]["force_n"].get<std::array<double, 3>>();
    return Eigen::Vector3d(numbers.data());
  };
  // Strains keep some five digits of positions in single precision.
  const double energy = alone["strain_energy_mj"];
  EXPECT_NEAR(served["strain_energy_mj"].get<double>(), energy, 1e-4 * energy);
  EXPECT_LT((force(served) - force(alone)).norm(), 1e-4 * force(alone).norm());
  EXPECT_NE(FindAttribute(ReadTetMesh(Path("run.vtu"))->point_data, "reaction_force_n"), nullptr);
  const auto band = [](const Json& of) {
    return of.at("material_uncertainty")["places"][0]["max_mm"].get<double>();
  };
  EXPECT_NEAR(band(of_run), band(of_deform), 1e-3 * band(of_deform));
}

TEST_F(ServedCommandTest, RunWithoutServerFailsAndWritesNothing) {
  EXPECT_EQ(Run({"run", kTonguePlan, "--server", "127.0.0.1:1", "--out", "run.vtu"}).exit_code, 1);
  EXPECT_FALSE(fs::exists(Path("run.vtu")));
}

TEST_F(ServedCommandTest, MeshesAreUploadedListedAndDeleted) {
  TetMeshFile file{.mesh = *tongue_.mesh, .point_data = {}, .cell_data = {}};
  file.cell_data.push_back(
      {"density", 1, std::vector<double>(static_cast<size_t>(file.mesh.num_tets()), 2.0)});
  ASSERT_THAT(WriteTetMesh(Path("mesh.vtu"), file), IsOk());
  const ProcessResult upload = OfServer({"mesh", "upload", "mesh.vtu"});
  EXPECT_EQ(upload.exit_code, 0) << upload.err;
  EXPECT_THAT(upload.out, HasSubstr("density"));
  const ProcessResult list = OfServer({"mesh", "list"});
  EXPECT_EQ(list.exit_code, 0) << list.err;
  EXPECT_THAT(list.out, HasSubstr("1 meshes"));
  const std::string name = list.out.substr(list.out.find("meshes/"), 71);
  EXPECT_EQ(OfServer({"mesh", "delete", name}).exit_code, 0);
  EXPECT_THAT(OfServer({"mesh", "delete", name}),
              FailsWith(1, HasSubstr("does not have this mesh")));
  EXPECT_NE(OfServer({"mesh", "upload", "none.vtu"}).exit_code, 0);
}

TEST_F(ServedCommandTest, ResumesAnInterruptedUploadAndSaysSo) {
  const TetMeshFile file{.mesh = *tongue_.mesh, .point_data = {}, .cell_data = {}};
  ASSERT_THAT(WriteTetMesh(Path("mesh.vtu"), file), IsOk());
  const MeshPayloadView payload = ViewMeshPayload(file.mesh.positions(), file.mesh.tets(), {});
  const auto stub = v1::MeshService::NewStub(
      grpc::CreateChannel(server_->address(), grpc::InsecureChannelCredentials()));
  grpc::ClientContext context;
  v1::UploadMeshResponse response;
  const auto writer = stub->UploadMesh(&context, &response);
  v1::UploadMeshRequest request;
  *request.mutable_header() = ToProto(payload.shape, payload.Sha256());
  writer->Write(request);
  request.mutable_chunk()->set_data(std::string(payload.segments[0].substr(0, 10'000)));
  writer->Write(request);
  writer->WritesDone();
  ASSERT_EQ(writer->Finish().error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  const ProcessResult upload = OfServer({"mesh", "upload", "mesh.vtu"});
  EXPECT_EQ(upload.exit_code, 0);
  EXPECT_THAT(upload.err,
              ContainsRegex("the upload continues: the server has 0.0 of [0-9.]+ MB already"));
  EXPECT_THAT(upload.out, HasSubstr(payload.Sha256()));
}

TEST_F(ServedCommandTest, UploadWarnsOfAMeshThatIsProbablyNotInMillimeters) {
  for (const double size_mm : {100.0, 0.1}) {
    const double scale = size_mm / tongue_.mesh->BoundingBoxDiagonal();
    const TetMeshFile file{
        .mesh = *TetMesh::Create(tongue_.mesh->positions() * scale, tongue_.mesh->tets()),
        .point_data = {},
        .cell_data = {}};
    ASSERT_THAT(WriteTetMesh(Path("mesh.vtu"), file), IsOk());
    const ProcessResult upload = OfServer({"mesh", "upload", "mesh.vtu"});
    EXPECT_EQ(upload.exit_code, 0);
    EXPECT_EQ(absl::StrContains(upload.err, "mesh.vtu: the diagonal of the bounding box is"),
              size_mm < 1);
  }
}

TEST_F(ServedCommandTest, WatchReportsASessionWithoutADrag) {
  EXPECT_THAT(OfServer({"watch", "0123456789abcdef"}), FailsWith(1, HasSubstr("no session")));
  ASSERT_OK_AND_ASSIGN(const auto client, TissueformClient::Connect(server_->address(), {}));
  ASSERT_OK_AND_ASSIGN(const auto session, PlanSession::Create(client.get(), tongue_));
  const ProcessResult watch = OfServer({"watch", session->name(), "--seconds", "1"});
  EXPECT_EQ(watch.exit_code, 0) << watch.err;
  EXPECT_THAT(watch.out, ContainsRegex("1 frames/s, age .* no drag: at rest\n"));
}

TEST_F(ServedCommandTest, ServerInfoAsTableAndAsJson) {
  ASSERT_OK_AND_ASSIGN(server_, ServerProcess::Start(ProgramPath("tissueform-server"),
                                                     {"--in-memory", "--port", "0", "--log-level",
                                                      "warn", "--max-sessions", "17"},
                                                     kPatience));
  EXPECT_THAT(OfServer({"server-info"}).out,
              AllOf(ContainsRegex("protocol +tissueform.v1"), ContainsRegex("max_sessions +17\n"),
                    ContainsRegex("neo_hookean +yes +yes\n"), ContainsRegex("arap +yes +no\n")));
  const Json info = Json::parse(OfServer({"server-info", "--json"}).out);
  EXPECT_EQ(info["limits"]["max_sessions"], 17);
  EXPECT_EQ(info["draining"], false);
  EXPECT_EQ(info["models"].size(), 4);
}

TEST_F(DemoCommandTest, ReportsTheMovementOfTheFaceAndWritesResultsAndPictures) {
  ASSERT_EQ(RunDemo("--plan " + kChinPlan + " --seconds 0.5"), 0);
  EXPECT_THAT(
      Read("out.txt"),
      AllOf(HasSubstr("dragging: chin 4 mm forward, over 0.5 s at 60 poses per second"),
            ContainsRegex("\nchin +[0-9.]+ +[0-9.]+ +[0-9.]+ +[0-9.]+\n"),
            ContainsRegex("\nnose +[0-9.]+"), HasSubstr("gradient_field and linear_elastic"),
            HasSubstr("\nface "), HasSubstr("not a medical device")));
  ExpectPictures();
  ASSERT_OK_AND_ASSIGN(const TetMeshFile result, ReadTetMesh(Path("result.vtu")));
  ASSERT_OK_AND_ASSIGN(const TriangleMeshFile skin, ReadTriangleMesh(Path("skin.stl")));
  EXPECT_EQ(skin.mesh.num_triangles(), BoundaryFacets(result.mesh).rows());
  EXPECT_GT(fs::file_size(Path("frames.csv")), 1000);

  const Json summary = Summary();
  EXPECT_EQ(summary["frames_sent"], 30);
  EXPECT_EQ(summary["frames_prepared"], summary["frames_answered"]);
  EXPECT_EQ(summary["frame_vertices"], BoundaryVertices(result.mesh).size());
  EXPECT_LT(summary["end_error_mm"], 0.01);  // the tolerance of prepared answers
  const Json& solved = summary["every_frame_solved"];
  EXPECT_EQ(solved["frames_sent"], 10);
  EXPECT_EQ(solved["frames_prepared"], 0);
  EXPECT_EQ(solved["frame_vertices"], result.mesh.num_vertices());
  EXPECT_EQ(solved["end_error_mm"], 0);
  EXPECT_LT(summary["rest_error_mm"], 1e-4);
  EXPECT_EQ(summary["inverted_tets"], 0);
  // What the file of the result says of the chin.
  const Json& chin = summary["movement"]["chin"];
  EXPECT_NEAR(chin["mean"]["total_mm"], MeanMovement(result, SkinRegion::kChin), 1e-9);
  EXPECT_GT(chin["mean"]["forward_mm"], 1);
  EXPECT_LT(chin["mean"]["forward_mm"], 4);
  EXPECT_LT(summary["movement"]["nose"]["foremost"]["total_mm"], 0.1);
}

TEST_F(DemoCommandTest, ComparesWithTheElasticModelAsInProcess) {
  ASSERT_EQ(RunDemo("--plan " + kTonguePlan + " --seconds 0.1 --encoding int16"), 0);
  EXPECT_GT(Summary()["end_error_mm"], 0);
  EXPECT_LT(Summary()["end_error_mm"], 0.0105);  // of prepared answers, and half of a step
  ASSERT_EQ(
      Run({"deform", kTonguePlan, "--model", "linear_elastic", "--out", "elastic.vtu"}).exit_code,
      0);
  ASSERT_OK_AND_ASSIGN(const TetMeshFile ours, ReadTetMesh(Path("result.vtu")));
  ASSERT_OK_AND_ASSIGN(const TetMeshFile other, ReadTetMesh(Path("elastic.vtu")));
  const Json difference = Summary()["difference"];
  EXPECT_EQ(difference["model"], "linear_elastic");
  // The largest difference is on the skin here; float32 steps at 8 mm are 4.8e-7 mm.
  EXPECT_NEAR(difference["regions"]["free skin"]["max_mm"],
              (ours.mesh.positions() - other.mesh.positions()).rowwise().norm().maxCoeff(), 2e-6);
  // What the server keeps of it, and how far neo_hookean lies from that.
  EXPECT_THAT(Read("out.txt"), ContainsRegex("stored by the server: predictions/[0-9a-f]+ "));
  EXPECT_THAT(Summary()["prediction"], StartsWith("predictions/"));
  const Json refinement = Summary()["refinement"];
  EXPECT_NE(refinement["prediction"], Summary()["prediction"]);
  EXPECT_EQ(refinement["distances"]["vertices"], ours.mesh.num_vertices());
  EXPECT_GT(refinement["distances"]["max_mm"], refinement["distances"]["mean_mm"]);
  // A tongue has no parts of a face.
  EXPECT_EQ(difference["regions"].size(), 1U);
  EXPECT_TRUE(Summary()["movement"].empty());
  EXPECT_THAT(Read("out.txt"), Not(HasSubstr("chin")));
  ExpectPictures();
}

TEST_F(DemoCommandTest, MovesTheJawOfTheBundledHeadBy8MmAlsoWithoutADisplay) {
  ASSERT_EQ(RunDemo("--seconds 0.3", "env -u DISPLAY PATH=/nonexistent "), 0);
  EXPECT_THAT(Read("out.txt"),
              AllOf(HasSubstr("plans/head/plan.json"), HasSubstr("mandible 8 mm forward"),
                    ContainsRegex("\nno pictures: [^\n]*xvfb[^\n]*\n")));
  EXPECT_FALSE(fs::exists(Path("front.png")));
  const Json summary = Summary();
  EXPECT_EQ(summary["inverted_tets"], 0);
  const Json& chin = summary["movement"]["chin"]["mean"];
  EXPECT_GT(chin["forward_mm"], 4 * 8 / 6.0);
  EXPECT_LT(chin["forward_mm"], 8.5);
  EXPECT_LT(summary["movement"]["nose"]["foremost"]["total_mm"], 1);
}

TEST_F(DemoCommandTest, ServesItsPredictionUntilInterrupted) {
  const std::string command = "echo $$; exec env -u DISPLAY PATH=/nonexistent " +
                              ProgramPath("tissueform") + " demo --serve --seconds 0.1 --plan " +
                              kTonguePlan + " --out " + folder_.string() + " 2>" + Path("err");
  FILE* demo = popen(command.c_str(), "r");
  ASSERT_NE(demo, nullptr);
  std::array<char, 512> line{};
  ASSERT_NE(std::fgets(line.data(), line.size(), demo), nullptr);
  const pid_t pid = std::atoi(line.data());
  ASSERT_GT(pid, 1);
  const std::string serves = "the server keeps running at ";
  bool served = false;
  while (std::fgets(line.data(), line.size(), demo) != nullptr) {
    const std::string text = line.data();
    if (text.rfind(serves, 0) != 0) continue;
    served = true;
    const std::string address = text.substr(serves.size(), text.find(',') - serves.size());
    const auto client = TissueformClient::Connect(address, {});
    EXPECT_THAT(client, IsOk());
    if (client.ok()) {
      const auto predictions = (*client)->predictions().List();
      EXPECT_THAT(predictions, IsOk());
      EXPECT_EQ(predictions.ok() ? predictions->size() : 0, 2U);
    }
    kill(pid, SIGINT);
  }
  EXPECT_TRUE(served) << Read("err");
  EXPECT_EQ(WEXITSTATUS(pclose(demo)), 0);
}

TEST_F(DemoCommandTest, ReportsATakenPortInOneLineBeforeAnyWork) {
  ASSERT_OK_AND_ASSIGN(
      const auto other,
      ServerProcess::Start(ProgramPath("tissueform-server"),
                           {"--in-memory", "--port", "0", "--log-level", "warn"}, kPatience));
  const std::string port = other->address().substr(other->address().rfind(':') + 1);
  for (const std::string option : {"--port", "--serve --web-port"}) {
    EXPECT_EQ(RunDemo(absl::StrCat(option, " ", port, " 2>", Path("err"))), 1);
    EXPECT_EQ(Read("out.txt"), "");
    EXPECT_EQ(Read("err"),
              absl::StrCat("tissueform: ", option.substr(option.rfind("--")), " ", port,
                           ": cannot listen on 127.0.0.1:", port,
                           ": Address already in use; use another port, or 0 for a free one\n"));
  }
}

TEST(ServerProcessTest, NamesAProgramThatEndsBeforeItListens) {
  for (const char* program : {"tissueform-server", "tissueform-gateway"}) {
    EXPECT_THAT(
        ServerProcess::Start(ProgramPath(program), {"--no-such-option"}, kPatience).status(),
        StatusIs(absl::StatusCode::kUnavailable,
                 StartsWith(std::string(program) + " ended before it was ready")));
  }
}

TEST_F(DemoCommandTest, AnInterruptedDemoEndsItsServer) {
  // The shell prints its process number and becomes the demo.
  const std::string command = "echo $$; exec " + ProgramPath("tissueform") + " demo --out " +
                              folder_.string() + " 2>" + Path("err");
  FILE* demo = popen(command.c_str(), "r");
  ASSERT_NE(demo, nullptr);
  std::array<char, 512> line{};
  ASSERT_NE(std::fgets(line.data(), line.size(), demo), nullptr);
  const pid_t pid = std::atoi(line.data());
  ASSERT_GT(pid, 1);
  std::string address;
  const std::string listens = "tissueform-server listens on ";
  while (std::fgets(line.data(), line.size(), demo) != nullptr) {
    const std::string text = line.data();
    if (text.rfind(listens, 0) == 0) {
      address = text.substr(listens.size(), text.find('\n') - listens.size());
      kill(pid, SIGINT);
    }
  }
  EXPECT_EQ(WEXITSTATUS(pclose(demo)), 1);
  ASSERT_FALSE(address.empty());
  TissueformClient::Options options;
  options.connect_deadline = std::chrono::milliseconds(300);
  EXPECT_THAT(TissueformClient::Connect(address, options),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr(address)));
}

}  // namespace
}  // namespace tissueform::testing
