// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <optional>
#include <utility>

#include "core/base/duration_histogram.h"
#include "server/session/frame_scheduler.h"
#include "server/telemetry/call_metrics.h"

// What metrics cost a frame and a call: tissueform-metrics-benchmark.
namespace tissueform {
namespace {

using Time = std::chrono::steady_clock;

constexpr int kRounds = 9;
constexpr int kRepetitions = 200'000;

// The shortest of some rounds: others have the machine, too.
template <typename Work>
double NanosecondsOf(const Work& work) {
  double best = 1e18;
  for (int round = 0; round < kRounds; ++round) {
    const auto start = Time::now();
    work();
    best = std::min(best, std::chrono::duration<double, std::nano>(Time::now() - start).count());
  }
  return best / kRepetitions;
}

// Poses in lockstep, all that a frame does to its flow.
double FrameNanoseconds(FrameMeasures* measures) {
  return NanosecondsOf([measures] {
    FrameScheduler flow(2, measures);
    for (int i = 1; i <= kRepetitions; ++i) {
      flow.Put(i, {}).IgnoreError();
      flow.StartSolve();
      const std::optional<WaitingPose> pose = flow.TakePose();
      AnswerFrame frame;
      frame.sequence = pose->sequence;
      flow.FinishSolve(std::move(frame));
      flow.TakeFrame();
      flow.Acknowledge(i, std::nullopt).IgnoreError();
    }
  });
}

// What a job in a lane is measured by.
double JobNanoseconds() {
  DurationHistogram waited;
  DurationHistogram ran;
  return NanosecondsOf([&] {
    for (int i = 0; i < kRepetitions; ++i) {
      const auto since = Time::now();
      const auto start = Time::now();
      waited.Observe(start - since);
      ran.Observe(Time::now() - start);
    }
  });
}

double CallNanoseconds() {
  CallMetrics metrics;
  const Principal nobody = {};
  const ObservedCall call{.method = "DeformService.AcknowledgeWatch",
                          .kind = CallKind::kMetadata,
                          .principal = nobody,
                          .resource = {},
                          .address = {},
                          .request_id = {},
                          .traceparent = {},
                          .served = true};
  return NanosecondsOf([&] {
    for (int i = 0; i < kRepetitions; ++i) {
      metrics.OnBegin(call).IgnoreError();
      metrics.OnEnd(call, absl::OkStatus(), std::chrono::milliseconds(1));
    }
  });
}

}  // namespace
}  // namespace tissueform

int main() {
  tissueform::FrameMeasures measures;
  const double without = tissueform::FrameNanoseconds(nullptr);
  const double with = tissueform::FrameNanoseconds(&measures);
  const double job = tissueform::JobNanoseconds();
  std::printf("flow of a frame: %.0f ns without metrics, %.0f ns with\n", without, with);
  std::printf("its job in a lane: %.0f ns of metrics\n", job);
  std::printf("a frame: %.0f ns of metrics\n", with - without + job);
  std::printf("a call: %.0f ns of metrics\n", tissueform::CallNanoseconds());
  return 0;
}
