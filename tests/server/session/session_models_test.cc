// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/session_models.h"

#include <array>
#include <fstream>
#include <malloc.h>
#include <string>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/linear_solvers/blas_threads.h"
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

// From here on the most is counted anew. False where the kernel does not allow it.
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
    SessionModels models(OptionsFor(model), budget);
    EXPECT_THAT(models.Begin(mesh, stiffness, constraints), IsOk());
    EXPECT_THAT(models.Prepare(model, {}), IsOk());
    held_ = models.bytes_held();
    malloc_trim(0);
    resident_ = ResidentBytes("VmRSS") - before;
    return ResidentBytes("VmHWM") - before;
  }

  int64_t held_ = 0;      // told
  int64_t resident_ = 0;  // measured
};

TEST_P(SessionMemoryTest, IsReservedBeforeItIsTakenAndToldAsItIs) {
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

class SessionModelsTest : public ::testing::Test {
 protected:
  SessionModelsTest() {
    EXPECT_THAT(
        models_.Begin(mesh_, Eigen::VectorXd::Constant(mesh_.num_tets(), 1000.0), constraints_),
        IsOk());
  }

  static ResponseRequest Request(double tolerance_mm) {
    return {.model = DeformationModel::kLinearElastic,
            .vertices = {0, 1, 2},
            .tolerance_mm = tolerance_mm};
  }

  const TetMesh mesh_ = Bar({3, 3, 6});
  const ConstraintSet constraints_ = testing::StackedHandles(mesh_, 1);
  MemoryBudget budget_{kPlenty};
  SessionModels models_{OptionsFor(DeformationModel::kGradientField), &budget_};
};

TEST_F(SessionModelsTest, AModelIsMadeOnce) {
  ASSERT_OK_AND_ASSIGN(Deformer* const first, models_.Prepare(DeformationModel::kArap, {}));
  const int64_t held = models_.bytes_held();
  ASSERT_OK_AND_ASSIGN(Deformer* const again, models_.Prepare(DeformationModel::kArap, {}));
  EXPECT_EQ(first, again);
  EXPECT_EQ(models_.bytes_held(), held);
  EXPECT_EQ(budget_.reserved_bytes(), held) << "what was expected and not needed is given back";
}

TEST_F(SessionModelsTest, WhatIsRefusedLeavesWhatWasThereAndMayBeAskedForAgain) {
  ASSERT_THAT(models_.Prepare(DeformationModel::kGradientField, {}), IsOk());
  const int64_t held = models_.bytes_held();
  {
    const MemoryReservation rest =
        *budget_.Reserve(kPlenty - budget_.reserved_bytes() - 1000, "rest of the machine");
    EXPECT_THAT(models_.Prepare(DeformationModel::kNeoHookean, {}),
                StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("no room")));
    EXPECT_EQ(models_.bytes_held(), held);
    EXPECT_THAT(models_.Prepare(DeformationModel::kGradientField, {}), IsOk()) << "it is there";
  }
  EXPECT_THAT(models_.Prepare(DeformationModel::kNeoHookean, {}), IsOk());
}

TEST_F(SessionModelsTest, OfPreparedAnswersTheOneThatWasNotUsedForLongestMakesWay) {
  ASSERT_OK_AND_ASSIGN(VertexResponse* const first, models_.PrepareResponse(Request(1.0), {}));
  int64_t held_with_four = 0;
  for (int i = 2; i <= 4; ++i) {
    ASSERT_THAT(models_.PrepareResponse(Request(i), {}), IsOk());
    held_with_four = models_.bytes_held();
  }
  ASSERT_OK_AND_ASSIGN(VertexResponse* const again, models_.PrepareResponse(Request(1.0), {}));
  EXPECT_EQ(first, again) << "kept, and the last used now";
  ASSERT_THAT(models_.PrepareResponse(Request(5.0), {}), IsOk());
  EXPECT_EQ(models_.bytes_held(), held_with_four) << "one came, one went";
  ASSERT_OK_AND_ASSIGN(VertexResponse* const kept, models_.PrepareResponse(Request(1.0), {}));
  EXPECT_EQ(first, kept) << "another made way";
}

TEST_F(SessionModelsTest, NotEveryModelHasPreparedAnswers) {
  for (const DeformationModel model : {DeformationModel::kArap, DeformationModel::kNeoHookean}) {
    ResponseRequest request = Request(1.0);
    request.model = model;
    EXPECT_THAT(models_.PrepareResponse(request, {}),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("prepared answers")));
  }
}

TEST_F(SessionModelsTest, CancelledAnswersLeaveNothing) {
  ASSERT_THAT(models_.Prepare(DeformationModel::kLinearElastic, {}), IsOk());
  const int64_t held = models_.bytes_held();
  EXPECT_THAT(models_.PrepareResponse(Request(1.0), Cancellation([] { return true; })),
              StatusIs(absl::StatusCode::kCancelled, HasSubstr("cancelled")));
  EXPECT_EQ(models_.bytes_held(), held);
  EXPECT_EQ(budget_.reserved_bytes(), held);
}

}  // namespace
}  // namespace tissueform
