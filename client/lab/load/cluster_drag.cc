// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/load/cluster_drag.h"

#include <algorithm>
#include <cmath>
#include <thread>
#include <utility>

#include "client/cpp/plan_session.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

// From rest to the plan's poses and back.
constexpr double kPeriodSeconds = 4;

double MillisecondsSince(ClusterDrag::SteadyClock::time_point start) {
  return std::chrono::duration<double, std::milli>(ClusterDrag::SteadyClock::now() - start).count();
}

ReattachingStream::Options StreamOptions(const PlanProblem& problem, bool int16) {
  ReattachingStream::Options options;
  options.stream.vertices.kind = AnswerVertices::Kind::kSkin;
  if (int16) options.stream.encoding = v1::POSITION_ENCODING_INT16_ZSTD;
  if (HasPreparedAnswers(problem.deformer, problem.constraints)) options.stream.prepared.emplace();
  return options;
}

double LongestGap(const std::vector<ShownFrame>& frames) {
  double longest = 0;
  for (size_t i = 1; i < frames.size(); ++i) {
    longest = std::max(longest, frames[i].shown_ms - frames[i - 1].shown_ms);
  }
  return longest;
}

template <typename T>
void Append(const std::vector<T>& from, std::vector<T>* to) {
  to->insert(to->end(), from.begin(), from.end());
}

}  // namespace

absl::StatusOr<std::unique_ptr<ClusterDrag>> ClusterDrag::Open(const ServerConnection& server,
                                                               const PlanProblem& problem,
                                                               const std::string& mesh,
                                                               const std::string& id,
                                                               const ClusterLoadOptions& options) {
  std::unique_ptr<ClusterDrag> drag(new ClusterDrag(options, NamedPoses(problem)));
  TF_ASSIGN_OR_RETURN(drag->client_, ConnectTo(server, /*own_connection=*/true));
  SessionRequest request = SessionRequestOf(problem, mesh);
  request.session_id = id;
  // Repeated behind a proxy it makes no second one.
  request.request_id = id;
  TF_ASSIGN_OR_RETURN(const v1::Session session, drag->client_->CreateSession(request));
  drag->session_ = session.name();
  ReattachingStream::Options stream = StreamOptions(problem, options.int16);
  stream.stream.on_notice = [drag = drag.get()](const v1::DeformNotice& notice) {
    drag->TakeNotice(notice);
  };
  TF_ASSIGN_OR_RETURN(drag->stream_,
                      ReattachingStream::Open(drag->client_.get(), drag->session_, stream));
  return drag;
}

ClusterDrag::~ClusterDrag() {
  stream_.reset();
  if (!session_.empty()) client_->DeleteSession(session_).IgnoreError();
}

void ClusterDrag::Run(SteadyClock::time_point start, SteadyClock::time_point end) {
  start_ = start;
  std::thread receiver([this] { Receive(); });
  const std::chrono::duration<double> interval(1 / options_.poses_per_second);
  const auto poses_a_commit = static_cast<int64_t>(
      std::max(1.0, std::round(options_.commit_seconds * options_.poses_per_second)));
  for (int64_t i = 0;; ++i) {
    const SteadyClock::time_point due =
        start + std::chrono::duration_cast<SteadyClock::duration>(interval * i);
    if (due >= end) break;
    std::this_thread::sleep_until(due);
    const double seconds = std::chrono::duration<double>(due - start).count();
    const double amount = (1 - std::cos(2 * M_PI * seconds / kPeriodSeconds)) / 2;
    const bool commit = options_.commit_seconds > 0 && (i + 1) % poses_a_commit == 0;
    if (SteadyClock::now() - due > interval) ++late_;
    if (commit) ++commits_sent_;
    send_times_.Append(MillisecondsSince(start));
    stream_->SendPoses(i, PartOfPoses(poses_, amount), commit);
  }
  end_ms_ = MillisecondsSince(start);
  stream_->CloseSending();
  receiver.join();
}

void ClusterDrag::Receive() {
  while (std::optional<v1::DeformFrame> frame = stream_->Receive()) TakeFrame(*frame);
  ++nodes_[stream_->node()].drags;
  status_ = stream_->Finish();
}

void ClusterDrag::TakeFrame(const v1::DeformFrame& frame) {
  stream_->Ack(frame);
  const double now_ms = MillisecondsSince(start_);
  const double sent_ms = send_times_.Get(frame.sequence());
  NodeLoad& node = nodes_[stream_->node()];
  ++node.frames;
  node.bytes += static_cast<int64_t>(frame.positions().size());
  node.coalesced += frame.coalesced_count();
  node.latencies_ms.push_back(now_ms - sent_ms);
  node.solves_ms.push_back(frame.summary().solve_seconds() * 1e3);
  frames_.push_back({sent_ms, now_ms});
  // The newest pose is sent once more to the next node, which may answer it a second time.
  if (!last_answered_.has_value() || frame.sequence() > *last_answered_) {
    last_answered_ = frame.sequence();
    ++answered_;
  }
}

void ClusterDrag::TakeNotice(const v1::DeformNotice& notice) {
  if (!notice.has_committed()) return;
  if (!notice.committed().failure().empty()) {
    ++commits_failed_;
    return;
  }
  nodes_[stream_->node()].commits_ms.push_back(MillisecondsSince(start_) -
                                               send_times_.Get(notice.committed().sequence()));
}

void ClusterDrag::AddTo(ClusterLoadResult* result) const {
  int64_t coalesced = 0;
  for (const auto& [name, own] : nodes_) {
    NodeLoad& node = result->nodes[name];
    node.drags += own.drags;
    node.frames += own.frames;
    node.bytes += own.bytes;
    node.coalesced += own.coalesced;
    coalesced += own.coalesced;
    Append(own.latencies_ms, &node.latencies_ms);
    Append(own.solves_ms, &node.solves_ms);
    Append(own.commits_ms, &node.commits_ms);
  }
  const int64_t sent = send_times_.size();
  result->poses_sent += sent;
  result->poses_late += late_;
  result->poses_answered += answered_;
  result->poses_coalesced += coalesced;
  result->poses_dropped += std::max<int64_t>(0, sent - answered_ - coalesced);
  result->commits_sent += commits_sent_;
  result->commits_failed += commits_failed_;
  result->reattachments += stream_->reattachments();
  result->longest_gap_ms = std::max(result->longest_gap_ms, LongestGap(frames_));
  if (sent > 0) {
    Append(PictureAges(send_times_.Get(0), end_ms_, frames_), &result->picture_ages_ms);
  }
  if (!status_.ok()) result->errors.push_back(status_);
}

}  // namespace tissueform
