// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// Random calls of the real program and of a model of it, which is plain maps of what was
// acknowledged and predicts every answer, code and reason; the program ends in between, by itself
// and by kill -9. Seeds and steps are fixed; by hand there may be more:
//
//   TISSUEFORM_MODEL_SEEDS=200 TISSUEFORM_MODEL_STEPS=400 build/release/bin/integration_model_test

#include <algorithm>
#include <cstdlib>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_join.h"
#include "gtest/gtest.h"

#include "core/base/status_macros.h"
#include "tests/integration/durable_server.h"
#include "tests/integration/model_answer_calls.h"
#include "tests/integration/model_case_calls.h"
#include "tests/integration/model_comparison.h"
#include "tests/integration/model_session_calls.h"

namespace tissueform::testing {
namespace {

enum class End { kNone, kDrain, kKill, kKillWithinACall };

struct Kind {
  uint32_t weight;
  absl::Status (*call)(ModelState&, const Numbers&);
  End end = End::kNone;
};

const Kind kKinds[] = {
    {4, UploadMesh},
    {2, GetMesh},
    {2, ListMeshes},
    {3, DeleteMesh},
    {12, CreateSession},
    {4, GetSession},
    {2, ListSessions},
    {8, UpdateSession},
    {4, DeleteSession},
    {6, DeformOnce},
    {8, Drag},
    {8, CreatePrediction},
    {2, ReadPrediction},
    {2, ListPredictions},
    {2, DeletePrediction},
    {5, ComparePredictions},
    {4, UploadCase},
    {2, ReadCase},
    {1, ListCases},
    {2, DeleteCase},
    {1, nullptr, End::kDrain},
    {1, nullptr, End::kKill},
    {2, nullptr, End::kKillWithinACall},
};

struct Step {
  const Kind* kind;
  Numbers numbers;
};
using Steps = std::vector<Step>;

Steps DrawSteps(uint32_t seed, int count) {
  std::mt19937 random(seed);
  std::vector<const Kind*> drawn;
  for (const Kind& kind : kKinds) drawn.insert(drawn.end(), kind.weight, &kind);
  // Both meshes first: without them most calls would be refused for want of one.
  Steps steps = {{.kind = &kKinds[0], .numbers = {0}}, {.kind = &kKinds[0], .numbers = {1}}};
  for (int i = 0; i < count; ++i) {
    Step step{.kind = drawn[random() % drawn.size()], .numbers = {}};
    for (uint32_t& number : step.numbers) number = static_cast<uint32_t>(random());
    // Now and then as a client calls again whose answer was lost: request ids are for that.
    steps.push_back(random() % 4 == 0 ? steps.back() : step);
  }
  return steps;
}

// A server of its own and the model beside it, from the beginning.
class ModelRun {
 public:
  absl::Status Run(const Steps& steps) {
    TF_RETURN_IF_ERROR(StartAs({{}}));
    for (const Step& step : steps) {
      ++steps_made_;
      TF_RETURN_IF_ERROR(Make(step));
    }
    TF_RETURN_IF_ERROR(CompareAll(state_, {state_.model}));
    TF_RETURN_IF_ERROR(Restart(End::kKill));
    return SolveAll(state_);
  }
  // With the one that failed.
  size_t steps_made() const { return steps_made_; }
  std::string Log() { return absl::StrJoin(state_.log, "\n  "); }

 private:
  absl::Status Make(const Step& step) {
    switch (step.kind->end) {
      case End::kNone:
        return step.kind->call(state_, step.numbers);
      case End::kKillWithinACall:
        return KillWithinACall(step.numbers);
      default:
        return Restart(step.kind->end);
    }
  }

  absl::Status Restart(End end) {
    state_.log.emplace_back(end == End::kDrain ? "drain and restart" : "kill -9 and restart");
    state_.Disconnect();
    TF_RETURN_IF_ERROR(end == End::kDrain ? server_.Drain() : server_.Kill());
    return StartAs({state_.model});
  }

  // What was under way is done or not, and done when it was acknowledged.
  absl::Status KillWithinACall(const Numbers& numbers) {
    ServedModel after = state_.model;
    const Change change = SomeChange(state_, numbers, &after);
    if (change == nullptr) return Restart(End::kKill);
    state_.log.push_back(absl::StrCat("kill -9 within call ", numbers[0] % 4));
    TF_ASSIGN_OR_RETURN(const auto other_client, server_.Connect());
    absl::Status outcome;
    std::thread caller([&] { outcome = change(); });
    // Some time of the machine's own.
    for (uint32_t i = 0; i < numbers[3] % 12; ++i) other_client->GetServerInfo().IgnoreError();
    const absl::Status killed = server_.Kill();
    caller.join();
    state_.Disconnect();
    TF_RETURN_IF_ERROR(killed);
    if (outcome.ok()) return StartAs({after});
    return StartAs({after, state_.model});
  }

  absl::Status StartAs(std::vector<ServedModel> possible) {
    TF_RETURN_IF_ERROR(server_.Start());
    TF_RETURN_IF_ERROR(state_.Connect(server_));
    for (ServedModel& model : possible) model.Restarted();
    return CompareAll(state_, possible);
  }

  DurableServer server_{"model",
                        {"--log-level", "off", "--workers", "2", "--max-stored-sessions",
                         std::to_string(kMaxSessions), "--max-cases", std::to_string(kMaxCases)}};
  ModelState state_;
  size_t steps_made_ = 0;
};

// What is left of the steps when none can be left out without the failure, as far as so many runs
// find it.
Steps Shortened(Steps steps, int runs) {
  size_t part = (steps.size() + 1) / 2;
  for (size_t begin = 0; runs > 0 && part > 0;) {
    if (begin >= steps.size()) {
      begin = 0;
      part /= 2;
      continue;
    }
    Steps fewer = steps;
    fewer.erase(fewer.begin() + static_cast<ptrdiff_t>(begin),
                fewer.begin() + static_cast<ptrdiff_t>(std::min(begin + part, steps.size())));
    --runs;
    ModelRun run;
    if (run.Run(fewer).ok()) {
      begin += part;
    } else {
      steps.assign(fewer.begin(), fewer.begin() + static_cast<ptrdiff_t>(run.steps_made()));
    }
  }
  return steps;
}

int FromEnvironment(const char* name, int otherwise) {
  const char* value = std::getenv(name);
  return value == nullptr ? otherwise : std::max(1, std::atoi(value));
}

constexpr int kParts = 4;  // which ctest may run at the same time

class ModelBasedTest : public ::testing::TestWithParam<int> {};

TEST_P(ModelBasedTest, EveryAnswerIsThatOfPlainMaps) {
  const int seeds = FromEnvironment("TISSUEFORM_MODEL_SEEDS", 2 * kParts);
  const int count = FromEnvironment("TISSUEFORM_MODEL_STEPS", 200);
  for (int seed = GetParam(); seed <= seeds; seed += kParts) {
    const Steps steps = DrawSteps(static_cast<uint32_t>(seed), count);
    ModelRun run;
    const absl::Status status = run.Run(steps);
    if (status.ok()) continue;
    ModelRun again;
    const absl::Status shorter = again.Run(
        Shortened({steps.begin(), steps.begin() + static_cast<ptrdiff_t>(run.steps_made())}, 100));
    FAIL() << "seed " << seed << ", " << count << " steps: " << status.message() << "\n  "
           << run.Log() << "\nshortened: " << shorter.message() << "\n  " << again.Log();
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, ModelBasedTest, ::testing::Range(1, kParts + 1),
                         [](const auto& part) { return "Part" + std::to_string(part.param); });

}  // namespace
}  // namespace tissueform::testing
