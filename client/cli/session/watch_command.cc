// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/session/watch_command.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "absl/strings/str_format.h"
#include "google/protobuf/util/time_util.h"

#include "client/cli/session/server_connection.h"
#include "client/cli/session/session_command.h"
#include "client/cli/shared/companion.h"
#include "client/cpp/reattaching_watch.h"
#include "core/base/mutex.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

struct WatchCommandOptions {
  ServerConnection server;
  std::string session;
  int64_t seconds = 0;  // 0: until it ends
};

// What the receiving thread has seen since the last line.
class Seen {
 public:
  void Take(const v1::WatchFrame& frame) {
    MutexLock lock(mutex_);
    ++frames_;
    number_ = frame.number();
    sequence_ = frame.frame().sequence();
    origin_ = frame.origin();
    time_ns_ = google::protobuf::util::TimeUtil::TimestampToNanoseconds(frame.time());
  }
  void End() {
    MutexLock lock(mutex_);
    ended_ = true;
    changed_.NotifyAll();
  }
  // Blocks until then, or the end; false when it has ended.
  bool WaitUntil(std::chrono::steady_clock::time_point time) {
    MutexLock lock(mutex_);
    while (!ended_ && changed_.WaitUntil(mutex_, time)) {
    }
    return !ended_;
  }
  void Print() {
    MutexLock lock(mutex_);
    const auto now_ns = std::chrono::duration_cast<std::chrono::nanoseconds>(
                            std::chrono::system_clock::now().time_since_epoch())
                            .count();
    const double age_ms = 1e-6 * static_cast<double>(now_ns - time_ns_);
    absl::PrintF("%3d frames/s, age %.1f ms, ", frames_, std::max(0.0, age_ms));
    if (origin_ == v1::WATCH_ORIGIN_DRAG) {
      absl::PrintF("sequence %d (frame %d)\n", sequence_, number_);
    } else {
      absl::PrintF("no drag: %s\n",
                   origin_ == v1::WATCH_ORIGIN_COMMITTED ? "the committed poses" : "at rest");
    }
    frames_ = 0;
  }

 private:
  Mutex mutex_;
  ConditionVariable changed_;
  bool ended_ ABSL_GUARDED_BY(mutex_) = false;
  int frames_ ABSL_GUARDED_BY(mutex_) = 0;
  uint64_t number_ ABSL_GUARDED_BY(mutex_) = 0;
  uint64_t sequence_ ABSL_GUARDED_BY(mutex_) = 0;
  v1::WatchOrigin origin_ ABSL_GUARDED_BY(mutex_) = v1::WATCH_ORIGIN_REST;
  int64_t time_ns_ ABSL_GUARDED_BY(mutex_) = 0;
};

void PrintNotice(const v1::DeformNotice& notice) {
  if (notice.has_draining()) {
    absl::PrintF("the server shuts down at %s at the latest\n",
                 google::protobuf::util::TimeUtil::ToString(notice.draining().end_time()));
  }
  if (notice.has_evicted()) absl::PrintF("the session was evicted from the server's memory\n");
  if (notice.has_restored()) absl::PrintF("the session is back in memory\n");
}

void Receive(ReattachingWatch* watch, Seen* seen) {
  while (const std::optional<v1::WatchFrame> frame = watch->Receive()) {
    seen->Take(*frame);
    watch->Ack(*frame);
  }
  seen->End();
}

absl::Status Run(const WatchCommandOptions& options) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);  // seen at once, also through a pipe
  TF_ASSIGN_OR_RETURN(const auto client, ConnectTo(options.server));
  const std::string session = FullSessionName(options.session);
  ReattachingWatch::Options watching;
  watching.watch.on_notice = PrintNotice;
  watching.reattachment.on_detached = [](const absl::Status& why) {
    absl::PrintF("%s\n", DetachedText(why));
  };
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<ReattachingWatch> watch,
                      ReattachingWatch::Open(client.get(), session, std::move(watching)));
  absl::PrintF("watching %s, %d vertices per frame\n", session, watch->form().vertex_count());
  Seen seen;
  std::thread receiver([&] { Receive(watch.get(), &seen); });
  const auto start = std::chrono::steady_clock::now();
  for (int64_t second = 1; options.seconds == 0 || second <= options.seconds; ++second) {
    if (!seen.WaitUntil(start + std::chrono::seconds(second))) break;
    seen.Print();
  }
  const bool ended = !seen.WaitUntil(start);
  if (!ended) watch->Cancel();
  receiver.join();
  const absl::Status end = watch->Finish();
  return ended ? end : absl::OkStatus();
}

}  // namespace

void AddWatchCommand(CLI::App& app, CommandWork* work) {
  auto options = std::make_shared<WatchCommandOptions>();
  CLI::App* command = app.add_subcommand(kWatchCommand.name, kWatchCommand.description);
  command->add_option("SESSION", options->session, "session name, with or without \"sessions/\"")
      ->required();
  AddServerOption(command, &options->server);
  command->add_option("--seconds", options->seconds, "seconds to watch; 0: until it ends")
      ->check(CLI::Range(0, 86400))
      ->capture_default_str();
  command->footer(
      "One line per second: new frames, age of the newest one by both machines' "
      "clocks, and its pose.\n"
      "Example, while `tissueform drag` runs:\n"
      "  tissueform session list --server localhost:50051\n"
      "  tissueform watch SESSION --server localhost:50051");
  command->callback([options, work] { *work = [options] { return Run(*options); }; });
}

}  // namespace tissueform
