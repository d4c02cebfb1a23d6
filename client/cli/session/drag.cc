// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/session/drag.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <memory>
#include <thread>
#include <utility>

#include "absl/strings/str_format.h"

#include "client/cli/session/server_connection.h"
#include "client/cpp/reattaching_stream.h"
#include "core/base/status_macros.h"
#include "core/base/stopwatch.h"
#include "core/mechanics/constraints/handle_pose.h"

namespace tissueform {
namespace {

using SteadyClock = std::chrono::steady_clock;

double Milliseconds(SteadyClock::duration duration) {
  return std::chrono::duration<double, std::milli>(duration).count();
}

void Receive(ReattachingStream* stream, SteadyClock::time_point start, const SendTimes& send_times,
             DragResult* result) {
  while (std::optional<v1::DeformFrame> frame = stream->Receive()) {
    const SteadyClock::time_point now = SteadyClock::now();
    stream->Ack(*frame);
    result->frames.push_back({.sequence = frame->sequence(),
                              .sent_ms = send_times.Get(frame->sequence()),
                              .received_ms = Milliseconds(now - start),
                              .solve_ms = frame->summary().solve_seconds() * 1e3,
                              .coalesced_count = frame->coalesced_count(),
                              .prepared = frame->summary().prepared()});
    result->coalesced += frame->coalesced_count();
    result->last_positions = std::move(*frame->mutable_positions());
    result->last_step_mm = frame->step_mm();
  }
}

}  // namespace

std::vector<NamedPose> PartOfPoses(absl::Span<const NamedPose> poses, double amount) {
  std::vector<NamedPose> parts;
  for (const NamedPose& pose : poses) {
    parts.push_back({pose.handle, PartOfPose(pose.pose, amount)});
  }
  return parts;
}

absl::StatusOr<DragResult> RunDrag(TissueformClient* client, const std::string& session,
                                   absl::Span<const NamedPose> poses, const DragOptions& options,
                                   const std::atomic<bool>& interrupted) {
  const Stopwatch opening;
  ReattachingStream::Options streaming = {.stream = options.stream};
  streaming.reattachment.give_up_after = kFailoverPatience;
  streaming.reattachment.on_detached = [](const absl::Status& why) {
    absl::FPrintF(stderr, "%s\n", DetachedText(why));
  };
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<ReattachingStream> stream,
                      ReattachingStream::Open(client, session, std::move(streaming)));
  DragResult result;
  result.open_seconds = opening.Seconds();
  result.vertex_count = stream->started().vertex_count();
  result.vertices = {stream->started().vertices().begin(), stream->started().vertices().end()};
  result.prepared_bytes = stream->started().prepared_bytes();
  result.encoding = options.stream.encoding;
  const auto count =
      std::max<int64_t>(1, static_cast<int64_t>(options.seconds * options.poses_per_second));
  const std::chrono::duration<double> interval(1 / options.poses_per_second);
  SendTimes send_times;
  const SteadyClock::time_point start = SteadyClock::now();
  std::atomic<bool> ended = false;  // Finish says why
  std::thread receiver([&] {
    Receive(stream.get(), start, send_times, &result);
    ended = true;
  });
  for (int64_t i = 0; i < count && !ended && !interrupted; ++i) {
    // Deadlines of their own: a late pose does not delay the ones after it.
    std::this_thread::sleep_until(start +
                                  std::chrono::duration_cast<SteadyClock::duration>(interval * i));
    // From rest to the end and at rest at both: as a hand moves, not at one speed.
    const double amount =
        (1 - std::cos(M_PI * static_cast<double>(i + 1) / static_cast<double>(count))) / 2;
    send_times.Append(Milliseconds(SteadyClock::now() - start));
    stream->SendPoses(i, PartOfPoses(poses, amount));
    ++result.poses_sent;
  }
  if (interrupted) {
    stream->Cancel();
  }
  stream->CloseSending();
  receiver.join();
  const absl::Status end = stream->Finish();
  if (interrupted) {
    return absl::CancelledError("interrupted");
  }
  TF_RETURN_IF_ERROR(end);
  return result;
}

}  // namespace tissueform
