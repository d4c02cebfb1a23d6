// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/shared_preparation.h"

#include <array>
#include <atomic>
#include <fstream>
#include <malloc.h>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mechanics/linear_solvers/blas_threads.h"
#include "tests/testing/handle_problem.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using ::tissueform::testing::Bar;
using ::tissueform::testing::IsOk;
using ::tissueform::testing::StatusIs;

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kOwnAllocator = true;  // a sanitizer's, with memory of its own
#else
constexpr bool kOwnAllocator = false;
#endif

// Memory of this process as the kernel counts it, in bytes: "VmRSS" now, "VmHWM" at most. -1 when
// it cannot be read.
int64_t ResidentBytes(const std::string& field) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.rfind(field + ":", 0) == 0) {
      int64_t kibibytes = 0;
      const size_t begin = line.find_first_of("0123456789");
      return absl::SimpleAtoi(line.substr(begin, line.find(' ', begin) - begin), &kibibytes)
                 ? kibibytes * 1024
                 : -1;
    }
  }
  return -1;
}

// From here on the maximum is counted again. False where the kernel does not allow it.
bool RestartHighWaterMark() {
  malloc_trim(0);
  std::ofstream file("/proc/self/clear_refs");
  file << "5" << std::flush;
  return file.good();
}

struct Shape {
  std::string name;
  std::array<int, 3> cells;
  int handles;
};

struct Case {
  Shape shape;
  DeformationModel model;
  std::string model_name;
};

void PrintTo(const Case& test_case, std::ostream* out) {
  *out << test_case.shape.name << test_case.model_name;
}

constexpr int64_t kPlenty = int64_t{1} << 40;

DeformerOptions OptionsFor(DeformationModel model) {
  DeformerOptions options;
  options.model = model;
  return options;
}

// What is reserved is compared with what the kernel says that the process took at most: nothing of
// the reservation's own arithmetic is in that.
class SessionMemoryTest : public ::testing::TestWithParam<Case> {
 protected:
  static void SetUpTestSuite() { SetBlasThreads(1); }  // as in the server

  void SetUp() override {
    if (kOwnAllocator) GTEST_SKIP() << "a sanitizer keeps memory of its own";
    // Libraries load their pages and make their own buffers at the first use.
    const TetMesh small = Bar({3, 3, 6});
    MemoryBudget budget(kPlenty);
    Prepare(small, 1, &budget);
  }

  // Makes the model and gives it back. Returns the most that the process took on top.
  int64_t Prepare(const TetMesh& mesh, int handles, MemoryBudget* budget) {
    const Eigen::VectorXd stiffness = Eigen::VectorXd::Constant(mesh.num_tets(), 1000.0);
    const ConstraintSet constraints = testing::StackedHandles(mesh, handles);
    const DeformationModel model = GetParam().model;
    EXPECT_TRUE(RestartHighWaterMark());
    const int64_t before = ResidentBytes("VmRSS");
    SharedPreparation preparation(budget, &pool_);
    EXPECT_THAT(preparation.Begin(mesh, stiffness, constraints, {}), IsOk());
    const auto deformer = preparation.MakeModel(OptionsFor(model), {});
    EXPECT_THAT(deformer, IsOk());
    // What a session reserves for itself when it has the model.
    const MemoryReservation own = *budget->Reserve((*deformer)->preparation().own_bytes, "session");
    held_ = preparation.bytes_held() + own.bytes();
    malloc_trim(0);
    resident_ = ResidentBytes("VmRSS") - before;
    return ResidentBytes("VmHWM") - before;
  }

  WorkerPool pool_{1};
  int64_t held_ = 0;      // reported
  int64_t resident_ = 0;  // measured
};

TEST_P(SessionMemoryTest, IsReservedBeforeItIsTaken) {
  const Shape& shape = GetParam().shape;
  const TetMesh mesh = Bar(shape.cells);
  MemoryBudget budget(kPlenty);
  const int64_t most = Prepare(mesh, shape.handles, &budget);
  const int64_t reserved = budget.most_reserved_bytes();
  std::printf("%lld vertices: %.1f MiB reserved, %.1f taken at most; %.1f told, %.1f held\n",
              static_cast<long long>(mesh.num_vertices()), reserved / 1048576.0, most / 1048576.0,
              held_ / 1048576.0, resident_ / 1048576.0);
  EXPECT_LE(most, reserved);
  EXPECT_EQ(budget.reserved_bytes(), 0) << "given back";
}

std::vector<Case> Cases() {
  // Slender, round, and a plate: factors of very different fill; many handles have many columns.
  const Shape shapes[] = {
      {"Slender", {8, 8, 90}, 1}, {"Round", {17, 17, 17}, 2}, {"Plate", {36, 36, 4}, 4}};
  std::vector<Case> cases;
  for (const Shape& shape : shapes) {
    cases.push_back({shape, DeformationModel::kGradientField, "GradientField"});
    cases.push_back({shape, DeformationModel::kArap, "Arap"});
    cases.push_back({shape, DeformationModel::kLinearElastic, "LinearElastic"});
    cases.push_back({shape, DeformationModel::kNeoHookean, "NeoHookean"});
  }
  return cases;
}

INSTANTIATE_TEST_SUITE_P(Shapes, SessionMemoryTest, ::testing::ValuesIn(Cases()),
                         [](const auto& of) {
                           return absl::StrCat(of.param.shape.name, of.param.model_name);
                         });

class SharedPreparationTest : public ::testing::Test {
 protected:
  SharedPreparationTest() { EXPECT_THAT(Begin(), IsOk()); }

  absl::Status Begin() {
    return preparation_.Begin(mesh_, Eigen::VectorXd::Constant(mesh_.num_tets(), 1000.0),
                              constraints_, {});
  }

  absl::StatusOr<std::unique_ptr<Deformer>> Make(DeformationModel model) {
    return preparation_.MakeModel(OptionsFor(model), {});
  }

  absl::StatusOr<std::shared_ptr<const SharedResponse>> Respond(
      const ResponseRequest& request, const Cancellation& cancellation = {}) {
    return preparation_.PrepareResponse(request, {}, cancellation);
  }

  static ResponseRequest Request(double tolerance_mm) {
    return {.model = DeformationModel::kLinearElastic,
            .vertices = {0, 1, 2},
            .tolerance_mm = tolerance_mm};
  }

  const TetMesh mesh_ = Bar({3, 3, 6});
  const ConstraintSet constraints_ = testing::StackedHandles(mesh_, 1);
  MemoryBudget budget_{kPlenty};
  WorkerPool pool_{1};
  SharedPreparation preparation_{&budget_, &pool_};
};

TEST_F(SharedPreparationTest, ReusesAnExistingPreparation) {
  ASSERT_OK_AND_ASSIGN(const auto first, Make(DeformationModel::kLinearElastic));
  const int64_t held = preparation_.bytes_held();
  EXPECT_THAT(Begin(), IsOk());
  ASSERT_OK_AND_ASSIGN(const auto second, Make(DeformationModel::kLinearElastic));
  EXPECT_NE(first, second) << "workspaces of their own";
  EXPECT_EQ(first->preparation().factorise_seconds, second->preparation().factorise_seconds);
  EXPECT_EQ(preparation_.bytes_held(), held);
  EXPECT_EQ(budget_.reserved_bytes(), held) << "what was expected and not needed is given back";
}

TEST_F(SharedPreparationTest, ModelsOfTwoCallersAnswerAtTheSameTimeAsOneAlone) {
  HandlePose pose;
  pose.rotation_vector = {0, 0, 0.2};
  for (const DeformationModel model :
       {DeformationModel::kGradientField, DeformationModel::kArap, DeformationModel::kLinearElastic,
        DeformationModel::kNeoHookean}) {
    ASSERT_OK_AND_ASSIGN(const auto alone, Make(model));
    ASSERT_OK_AND_ASSIGN(const Deformation expected, alone->Deform({pose}));
    std::vector<std::thread> callers;
    std::atomic<int> equal = 0;
    for (int i = 0; i < 4; ++i) {
      ASSERT_OK_AND_ASSIGN(std::unique_ptr<Deformer> own, Make(model));
      callers.emplace_back([&, deformer = std::move(own)] {
        for (int repeat = 0; repeat < 5; ++repeat) {
          const absl::StatusOr<Deformation> answer = deformer->Deform({pose});
          if (answer.ok() && answer->positions == expected.positions) ++equal;
        }
      });
    }
    for (std::thread& caller : callers) caller.join();
    EXPECT_EQ(equal, 20);
  }
}

TEST_F(SharedPreparationTest, PreparedAnswersMayBeAskedByManyAtOnce) {
  for (const DeformationModel model :
       {DeformationModel::kGradientField, DeformationModel::kLinearElastic}) {
    ResponseRequest request = Request(1.0);
    request.model = model;
    ASSERT_OK_AND_ASSIGN(const auto shared, Respond(request));
    std::vector<HandlePose> poses(20);
    for (size_t i = 0; i < poses.size(); ++i) {
      poses[i].translation_mm = {0.1 * static_cast<double>(i), 0, 0};
    }
    std::vector<FloatPositions> expected(poses.size());
    for (size_t i = 0; i < poses.size(); ++i) shared->response->Evaluate({poses[i]}, &expected[i]);
    std::vector<std::thread> callers;
    std::atomic<int> equal = 0;
    for (size_t c = 0; c < 4; ++c) {
      callers.emplace_back([&, c] {
        for (size_t i = 0; i < poses.size(); ++i) {
          const size_t at = (i + 5 * c) % poses.size();
          FloatPositions positions;
          if (shared->response->Answer({poses[at]}, &positions).has_value() &&
              positions == expected[at]) {
            ++equal;
          }
        }
      });
    }
    for (std::thread& caller : callers) caller.join();
    EXPECT_EQ(equal, 80);
  }
}

// Two factorisations more where Poisson's ratio is in doubt.
TEST_F(SharedPreparationTest, TheBandIsMadeOnceForTheModelsOfTheSameVerticesAndRanges) {
  ResponseRequest request = Request(1.0);
  request.ranges.emplace().tissues = {{"all", 2}};
  request.ranges->tissue_of_tet.assign(static_cast<size_t>(mesh_.num_tets()), 0);
  ASSERT_OK_AND_ASSIGN(const auto linear, Respond(request));
  request.model = DeformationModel::kNeoHookean;
  ASSERT_OK_AND_ASSIGN(const auto neo_hookean, Respond(request));
  ASSERT_NE(linear->band, nullptr);
  EXPECT_EQ(neo_hookean->band, linear->band);
  EXPECT_NE(neo_hookean->response, linear->response);
  request.vertices.pop_back();
  ASSERT_OK_AND_ASSIGN(const auto fewer, Respond(request));
  EXPECT_NE(fewer->band, linear->band);
  request.ranges->tissues[0].factor_95 = 3;
  ASSERT_OK_AND_ASSIGN(const auto wider, Respond(request));
  EXPECT_NE(wider->band, fewer->band);
  request.ranges.reset();
  ASSERT_OK_AND_ASSIGN(const auto without, Respond(request));
  EXPECT_EQ(without->band, nullptr);
}

TEST_F(SharedPreparationTest, ARefusalKeepsThePreparationAndMayBeRetried) {
  ASSERT_THAT(Make(DeformationModel::kGradientField), IsOk());
  const int64_t held = preparation_.bytes_held();
  {
    const MemoryReservation rest =
        *budget_.Reserve(kPlenty - budget_.reserved_bytes() - 1000, "rest of the machine");
    EXPECT_THAT(Make(DeformationModel::kNeoHookean),
                StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("no memory for")));
    EXPECT_EQ(preparation_.bytes_held(), held);
  }
  EXPECT_THAT(Make(DeformationModel::kNeoHookean), IsOk());
}

TEST_F(SharedPreparationTest, EvictsTheLeastRecentlyUsedPreparedAnswers) {
  ASSERT_OK_AND_ASSIGN(const auto first, Respond(Request(1.0)));
  int64_t held_with_four = 0;
  for (int i = 2; i <= 4; ++i) {
    ASSERT_THAT(Respond(Request(i)), IsOk());
    held_with_four = preparation_.bytes_held();
  }
  ASSERT_OK_AND_ASSIGN(const auto again, Respond(Request(1.0)));
  EXPECT_EQ(first, again) << "kept, and the last used now";
  ASSERT_THAT(Respond(Request(5.0)), IsOk());
  EXPECT_EQ(preparation_.bytes_held(), held_with_four) << "one came, one went";
  ASSERT_OK_AND_ASSIGN(const auto kept, Respond(Request(1.0)));
  EXPECT_EQ(first, kept) << "another made way";
}

TEST_F(SharedPreparationTest, EvictedAnswersStayWithTheirUsersAndInTheBudget) {
  ASSERT_OK_AND_ASSIGN(auto first, Respond(Request(1.0)));
  const int64_t bytes = first->reservation.bytes();
  EXPECT_EQ(bytes, first->response->bytes_held());
  for (int i = 2; i <= 5; ++i) ASSERT_THAT(Respond(Request(i)), IsOk());
  EXPECT_EQ(budget_.reserved_bytes(), preparation_.bytes_held() + bytes);
  first.reset();
  EXPECT_EQ(budget_.reserved_bytes(), preparation_.bytes_held());
}

TEST_F(SharedPreparationTest, NotEveryModelHasPreparedAnswers) {
  ResponseRequest request = Request(1.0);
  request.model = DeformationModel::kArap;
  EXPECT_THAT(Respond(request),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("prepared answers")));
}

TEST_F(SharedPreparationTest, CancelledAnswersLeaveNothing) {
  ASSERT_THAT(Make(DeformationModel::kLinearElastic), IsOk());
  const int64_t held = preparation_.bytes_held();
  EXPECT_THAT(Respond(Request(1.0), Cancellation([] { return true; })),
              StatusIs(absl::StatusCode::kCancelled, HasSubstr("canceled")));
  EXPECT_EQ(preparation_.bytes_held(), held);
  EXPECT_EQ(budget_.reserved_bytes(), held);
}

class SharedPreparationsTest : public ::testing::Test {
 protected:
  static SessionRecord Record() {
    SessionRecord record;
    record.owner = "clinic";
    record.mesh_sha256 = std::string(64, 'a');
    record.stiffness = 1000.0;
    record.fixed = {0, 1};
    record.handles = {{"jaw", {2, 3}}};
    return record;
  }

  MemoryBudget budget_{kPlenty};
  WorkerPool pool_{1};
  SharedPreparations preparations_{&budget_, &pool_};
};

TEST_F(SharedPreparationsTest, AreSharedByRecordsWithTheSameProblem) {
  const auto first = preparations_.Find(Record());
  SessionRecord record = Record();
  record.id = "another";
  record.request_id = "another";
  record.model = DeformationModel::kArap;
  record.gradient_field.max_iterations = 3;
  EXPECT_EQ(preparations_.Find(record), first);
}

TEST_F(SharedPreparationsTest, AreNotSharedAcrossDifferentProblemsOrOwners) {
  const auto first = preparations_.Find(Record());
  const auto differs = [&](auto change) {
    SessionRecord record = Record();
    change(record);
    EXPECT_NE(preparations_.Find(record), first);
  };
  differs([](SessionRecord& record) { record.owner = "another clinic"; });
  differs([](SessionRecord& record) { record.project = "study"; });
  differs([](SessionRecord& record) { record.mesh_sha256 = std::string(64, 'b'); });
  differs([](SessionRecord& record) { record.stiffness = 1001.0; });
  differs([](SessionRecord& record) { record.stiffness = "youngs_modulus_pa"; });
  differs([](SessionRecord& record) { record.fixed = {0}; });
  differs([](SessionRecord& record) { record.handles[0].vertices = {2}; });
  differs([](SessionRecord& record) { record.handles[0].name = "chin"; });
  differs([](SessionRecord& record) { record.poisson_ratio = 0.3; });
}

TEST_F(SharedPreparationsTest, EndWithTheirLastUser) {
  std::weak_ptr<SharedPreparation> first = preparations_.Find(Record());
  EXPECT_TRUE(first.expired());
  EXPECT_NE(preparations_.Find(Record()), nullptr);
}

}  // namespace
}  // namespace tissueform
