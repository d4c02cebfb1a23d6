// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/benchmarks/interleaved.h"

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"

#include "benchmark/benchmark.h"
#include "core/base/percentiles.h"
#include "core/base/stopwatch.h"

namespace tissueform::benchmarks {
namespace {

// Collects the counters of all repetitions instead of printing them.
class MedianReporter : public benchmark::BenchmarkReporter {
 public:
  bool ReportContext(const Context& /*context*/) override { return true; }

  void ReportRuns(const std::vector<Run>& runs) override {
    for (const Run& run : runs) {
      if (run.error_occurred) {
        status_.Update(
            absl::InternalError(absl::StrCat(run.run_name.function_name, ": ", run.error_message)));
      } else if (run.run_type == Run::RT_Iteration) {
        for (const auto& [part, seconds] : run.counters) {
          seconds_[absl::StrCat(run.run_name.function_name, "/", part)].push_back(seconds);
        }
      }
    }
  }

  absl::StatusOr<PartSeconds> Medians() const {
    if (!status_.ok()) {
      return status_;
    }
    PartSeconds medians;
    for (const auto& [name, seconds] : seconds_) {
      medians[name] = Median(seconds);
    }
    return medians;
  }

 private:
  absl::Status status_;
  std::map<std::string, std::vector<double>> seconds_;
};

void RunRepetition(const TimedWork& work, benchmark::State& state) {
  PartSeconds sums;
  for ([[maybe_unused]] auto _ : state) {
    const absl::StatusOr<PartSeconds> seconds = work.run();
    if (!seconds.ok()) {
      state.SkipWithError(std::string(seconds.status().message()).c_str());
      break;
    }
    double total = 0;
    for (const auto& [part, part_seconds] : *seconds) {
      sums[part] += part_seconds;
      total += part_seconds;
    }
    state.SetIterationTime(total);
  }
  for (const auto& [part, sum] : sums) {
    state.counters[part] = benchmark::Counter(sum, benchmark::Counter::kAvgIterations);
  }
}

void InitializeOnce() {
  static const bool initialized = [] {
    std::string program = "tissueform-benchmarks";
    // Repetitions of all work in random order: other load on the machine, and how warm it is,
    // affects ours and the peers alike.
    std::string interleave = "--benchmark_enable_random_interleaving=true";
    char* arguments[] = {program.data(), interleave.data(), nullptr};
    int count = 2;
    benchmark::Initialize(&count, arguments);
    return true;
  }();
  static_cast<void>(initialized);
}

}  // namespace

absl::StatusOr<PartSeconds> InterleavedMedians(const std::vector<TimedWork>& work,
                                               int repetitions) {
  InitializeOnce();
  for (const TimedWork& piece : work) {
    benchmark::RegisterBenchmark(piece.name.c_str(),
                                 [&piece](benchmark::State& state) { RunRepetition(piece, state); })
        ->Iterations(piece.runs_per_repetition)
        ->Repetitions(repetitions)
        ->UseManualTime();
  }
  MedianReporter reporter;
  benchmark::RunSpecifiedBenchmarks(&reporter);
  benchmark::ClearRegisteredBenchmarks();
  return reporter.Medians();
}

double SecondsOf(const std::function<void()>& work) {
  const Stopwatch stopwatch;
  work();
  return stopwatch.Seconds();
}

}  // namespace tissueform::benchmarks
