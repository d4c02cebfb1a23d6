// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/load/load_run.h"

#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <memory>
#include <thread>
#include <utility>

#include "absl/strings/str_format.h"

#include "client/cli/session/drag.h"
#include "client/cli/session/session_wait.h"
#include "client/cpp/plan_session.h"
#include "client/cpp/reattaching_stream.h"
#include "client/cpp/tissueform_client.h"
#include "client/lab/load/picture_age.h"
#include "core/base/status_macros.h"
#include "core/base/stopwatch.h"

namespace tissueform {
namespace {

using SteadyClock = std::chrono::steady_clock;

// From rest to the plan's pose and back.
constexpr double kPeriodSeconds = 4;
// Until every drag's thread waits for its first pose.
constexpr std::chrono::milliseconds kLeadTime{200};
// The smallest of the stiffnesses of churn; each session takes one that was not there before.
constexpr double kChurnStiffnessPa = 1e4;

double Milliseconds(SteadyClock::duration duration) {
  return std::chrono::duration<double, std::milli>(duration).count();
}

SteadyClock::duration Seconds(double seconds) {
  return std::chrono::duration_cast<SteadyClock::duration>(std::chrono::duration<double>(seconds));
}

// One drag with its session and stream, until it is run.
class LoadDrag {
 public:
  struct Kind {
    bool neo_hookean = false;
    double slow_ms = 0;  // that the client takes for each frame
    bool int16 = false;
  };

  static absl::StatusOr<std::unique_ptr<LoadDrag>> Open(const ServerConnection& server,
                                                        const PlanProblem& problem,
                                                        const Kind& kind) {
    auto drag = std::unique_ptr<LoadDrag>(new LoadDrag(kind, NamedPoses(problem)));
    TF_ASSIGN_OR_RETURN(drag->client_, ConnectTo(server, /*own_connection=*/true));
    TF_ASSIGN_OR_RETURN(drag->session_, MakePlanSession(drag->client_.get(), problem, nullptr));
    ReattachingStream::Options options;
    DeformStream::Options& stream = options.stream;
    stream.vertices.kind = AnswerVertices::Kind::kSkin;
    if (kind.int16) stream.encoding = v1::POSITION_ENCODING_INT16_ZSTD;
    if (kind.neo_hookean) {
      stream.model = v1::DEFORMATION_MODEL_NEO_HOOKEAN;
    } else if (HasPreparedAnswers(problem.deformer, problem.constraints)) {
      stream.prepared.emplace();
    }
    options.reattachment.give_up_after = kFailoverPatience;
    options.reattachment.on_detached = [](const absl::Status& why) {
      absl::FPrintF(stderr, "%s\n", DetachedText(why));
    };
    TF_ASSIGN_OR_RETURN(
        drag->stream_,
        ReattachingStream::Open(drag->client_.get(), drag->session_->name(), std::move(options)));
    const auto& skin = drag->stream_->started().vertices();
    drag->rest_ =
        problem.mesh->positions()(std::vector<int32_t>(skin.begin(), skin.end()), Eigen::all);
    return drag;
  }

  // Sends poses from `start` on, every `interval` until `end`, and takes the frames.
  void Run(SteadyClock::time_point origin, SteadyClock::time_point start,
           SteadyClock::time_point end, SteadyClock::duration interval) {
    std::atomic<bool> ended = false;  // Finish says why
    std::thread receiver([&] {
      Receive(origin);
      ended = true;
    });
    for (int64_t i = 0; !ended; ++i) {
      const SteadyClock::time_point due = start + interval * i;
      if (due >= end) break;
      std::this_thread::sleep_until(due);
      const double seconds = std::chrono::duration<double>(due - start).count();
      const double amount = (1 - std::cos(2 * M_PI * seconds / kPeriodSeconds)) / 2;
      send_times_.Append(Milliseconds(SteadyClock::now() - origin));
      stream_->SendPoses(i, PartOfPoses(poses_, amount));
    }
    end_ms_ = Milliseconds(SteadyClock::now() - origin);
    stream_->CloseSending();
    receiver.join();
    status_ = stream_->Finish();
    if (status_.ok()) status_ = decoded_;
  }

  const absl::Status& status() const { return status_; }

  void AddTo(DragLoad* load) const {
    ++load->drags;
    load->poses_sent += send_times_.size();
    load->frames += static_cast<int64_t>(frames_.size());
    load->bytes += bytes_;
    for (const ShownFrame& frame : frames_) {
      load->latencies_ms.push_back(frame.shown_ms - frame.sent_ms);
    }
    load->solves_ms.insert(load->solves_ms.end(), solves_ms_.begin(), solves_ms_.end());
    if (send_times_.size() == 0) return;
    const std::vector<double> ages = PictureAges(send_times_.Get(0), end_ms_, frames_);
    load->picture_ages_ms.insert(load->picture_ages_ms.end(), ages.begin(), ages.end());
  }

 private:
  LoadDrag(const Kind& kind, std::vector<NamedPose> poses)
      : kind_(kind), poses_(std::move(poses)) {}

  void Receive(SteadyClock::time_point origin) {
    while (std::optional<v1::DeformFrame> frame = stream_->Receive()) {
      // What is shown must be read first; float32 is shown as it is.
      if (kind_.int16 && decoded_.ok()) {
        decoded_ = DecodePositions(frame->positions(), v1::POSITION_ENCODING_INT16_ZSTD,
                                   frame->step_mm(), rest_)
                       .status();
      }
      frames_.push_back(
          {send_times_.Get(frame->sequence()), Milliseconds(SteadyClock::now() - origin)});
      solves_ms_.push_back(frame->summary().solve_seconds() * 1e3);
      bytes_ += static_cast<int64_t>(frame->positions().size());
      if (kind_.slow_ms > 0) std::this_thread::sleep_for(Seconds(kind_.slow_ms / 1e3));
      stream_->Ack(*frame);
    }
  }

  const Kind kind_;
  const std::vector<NamedPose> poses_;
  std::unique_ptr<TissueformClient> client_;
  std::unique_ptr<PlanSession> session_;
  std::unique_ptr<ReattachingStream> stream_;
  Positions rest_;  // of what the stream answers

  // Self-synchronised.
  SendTimes send_times_;

  // Written while it runs, by one thread each.
  std::vector<ShownFrame> frames_;
  std::vector<double> solves_ms_;
  int64_t bytes_ = 0;
  double end_ms_ = 0;
  absl::Status decoded_;
  absl::Status status_;
};

// A client that makes and deletes sessions until `stop` is set.
class Churn {
 public:
  // `number` of `count`, so that no two sessions have the same stiffness.
  Churn(std::unique_ptr<TissueformClient> client, SessionRequest request, int number, int count)
      : number_(number), count_(count), client_(std::move(client)), request_(std::move(request)) {}

  void Run(const std::atomic<bool>& stop) {
    for (int round = 0; !stop; ++round) {
      request_.stiffness = kChurnStiffnessPa + round * count_ + number_;
      const Stopwatch stopwatch;
      const absl::StatusOr<v1::Session> session = client_->CreateSession(request_);
      if (session.ok()) seconds_.push_back(stopwatch.Seconds());
      const absl::Status status =
          session.ok() ? client_->DeleteSession(session->name()) : session.status();
      if (!status.ok()) {
        errors_.push_back(status);
        std::this_thread::sleep_for(Seconds(0.1));  // refusals at once would be another load
      }
    }
  }

  const std::vector<double>& seconds() const { return seconds_; }
  const std::vector<absl::Status>& errors() const { return errors_; }

 private:
  const int number_;
  const int count_;
  const std::unique_ptr<TissueformClient> client_;
  SessionRequest request_;
  std::vector<double> seconds_;
  std::vector<absl::Status> errors_;
};

struct DragGroup {
  std::string name;
  LoadDrag::Kind kind;
  int count = 0;
  std::vector<std::unique_ptr<LoadDrag>> drags;
};

std::vector<DragGroup> GroupsOf(const LoadOptions& options) {
  std::vector<DragGroup> groups;
  const bool int16 = options.int16;
  groups.push_back({"prepared", {.int16 = int16}, options.sessions, {}});
  groups.push_back(
      {"slow reader", {.slow_ms = options.slow_ms, .int16 = int16}, options.slow_readers, {}});
  groups.push_back({"neo_hookean", {.neo_hookean = true, .int16 = int16}, options.refining, {}});
  return groups;
}

absl::Status Open(const ServerConnection& server, const PlanProblem& problem, DragGroup* group) {
  for (int i = 0; i < group->count; ++i) {
    TF_ASSIGN_OR_RETURN(std::unique_ptr<LoadDrag> drag,
                        LoadDrag::Open(server, problem, group->kind));
    group->drags.push_back(std::move(drag));
  }
  return absl::OkStatus();
}

void RunAll(const LoadOptions& options, const std::vector<DragGroup>& groups,
            const std::vector<std::unique_ptr<Churn>>& churn) {
  std::atomic<bool> stop = false;
  std::vector<std::thread> churning;
  churning.reserve(churn.size());
  for (const auto& client : churn) {
    churning.emplace_back([&client, &stop] { client->Run(stop); });
  }
  const SteadyClock::time_point origin = SteadyClock::now();
  const SteadyClock::time_point first = origin + kLeadTime;
  const SteadyClock::time_point end = first + Seconds(options.seconds);
  const SteadyClock::duration interval = Seconds(1 / options.poses_per_second);
  const int count = options.sessions + options.slow_readers + options.refining;
  std::vector<std::thread> dragging;
  dragging.reserve(count);
  for (const DragGroup& group : groups) {
    for (const auto& drag : group.drags) {
      const auto number = static_cast<int64_t>(dragging.size());
      const SteadyClock::time_point start =
          options.in_phase ? first : first + interval * number / count;
      dragging.emplace_back([=, &drag] { drag->Run(origin, start, end, interval); });
    }
  }
  std::this_thread::sleep_until(end);  // churn may be all that is asked for
  for (std::thread& thread : dragging) thread.join();
  stop = true;
  for (std::thread& thread : churning) thread.join();
}

}  // namespace

absl::StatusOr<LoadResult> RunLoad(const ServerConnection& server, const PlanProblem& problem,
                                   const LoadOptions& options) {
  LoadResult result;
  const Stopwatch preparing;
  std::vector<DragGroup> groups = GroupsOf(options);
  for (DragGroup& group : groups) TF_RETURN_IF_ERROR(Open(server, problem, &group));
  // Even without drags, the mesh is on the server while churn makes sessions of it.
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<TissueformClient> client, ConnectTo(server));
  TF_ASSIGN_OR_RETURN(const v1::Mesh mesh, UploadMeshOf(client.get(), problem));
  std::vector<std::unique_ptr<Churn>> churn;
  for (int i = 0; i < options.churn; ++i) {
    TF_ASSIGN_OR_RETURN(std::unique_ptr<TissueformClient> own,
                        ConnectTo(server, /*own_connection=*/true));
    churn.push_back(std::make_unique<Churn>(std::move(own), SessionRequestOf(problem, mesh.name()),
                                            i, options.churn));
  }
  result.preparing_seconds = preparing.Seconds();
  RunAll(options, groups, churn);
  for (const DragGroup& group : groups) {
    if (group.drags.empty()) continue;
    DragLoad load;
    load.kind = group.name;
    for (const auto& drag : group.drags) {
      drag->AddTo(&load);
      if (!drag->status().ok()) result.errors.push_back(drag->status());
    }
    result.drags.push_back(std::move(load));
  }
  for (const auto& client_of_churn : churn) {
    result.session_seconds.insert(result.session_seconds.end(), client_of_churn->seconds().begin(),
                                  client_of_churn->seconds().end());
    result.errors.insert(result.errors.end(), client_of_churn->errors().begin(),
                         client_of_churn->errors().end());
  }
  return result;
}

}  // namespace tissueform
