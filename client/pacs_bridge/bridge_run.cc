// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/bridge_run.h"

#include <chrono>
#include <csignal>
#include <cstdio>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "spdlog/spdlog.h"

#include "client/pacs_bridge/bridge_parts.h"
#include "client/pacs_bridge/work/bridge_service.h"
#include "core/base/status_macros.h"
#include "server/platform/systemd_notices.h"

namespace tissueform {
namespace {

void LogLine(bool wrong, const std::string& line) {
  spdlog::log(wrong ? spdlog::level::warn : spdlog::level::info, "{}", line);
}

// Passes what comes on, and wakes who works on it when an association has ended.
class WakingSink final : public InstanceSink {
 public:
  WakingSink(InstanceSink* sink, std::function<void()> wake)
      : sink_(sink), wake_(std::move(wake)) {}

  absl::Status Keep(const ReceivedInstance& instance) override { return sink_->Keep(instance); }
  void AssociationEnded(const EndedAssociation& ended) override {
    sink_->AssociationEnded(ended);
    LogLine(!ended.released, absl::StrFormat("association %d ended: %d objects, %d refused%s%s",
                                             ended.association, ended.kept, ended.refused,
                                             ended.problem.empty() ? "" : ": ", ended.problem));
    wake_();
  }
  void ConnectionRefused(const RefusedConnection& refused) override {
    sink_->ConnectionRefused(refused);
  }

 private:
  InstanceSink* const sink_;
  const std::function<void()> wake_;
};

void WaitForEnd() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  int number = 0;
  sigwait(&signals, &number);
}

// The options of the review page, whose logins are audited where that is set.
ReviewOptions ReviewOptionsOf(const BridgeOptions& options, AccessAudit* audit) {
  ReviewOptions review = options.review;
  if (audit == nullptr) return review;
  review.on_login = [audit](const ReviewLogin& login) {
    if (login.is_accepted) return audit->LoginAccepted(login.address, login.user);
    audit->LoginRefused(login.address, login.user);
    return absl::OkStatus();
  };
  return review;
}

absl::Status CheckRunnable(const BridgeOptions& options) {
  if (options.server.empty()) {
    return absl::FailedPreconditionError(
        "give --server HOST:PORT, or use `listen` to receive only");
  }
  return RulesOf(options).status();
}

absl::Status Serve(const BridgeOptions& options, BridgeRunKind kind) {
  const bool everything = kind == BridgeRunKind::kEverything;
  if (everything) TF_RETURN_IF_ERROR(CheckRunnable(options));
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<BridgeParts> parts, BridgeParts::Open(options));
  PlanWorkOptions planning = options.plan;
  planning.cancel = parts->cancel();
  PlanWork plans(&parts->queue(), parts->server(), planning);
  const std::unique_ptr<ExportWork> exports = everything ? parts->MakeExportWork() : nullptr;
  if (everything && exports == nullptr) {
    LogLine(true,
            "no PACS to store predictions in; give --pacs HOST:PORT or "
            "--pacs-url URL");
  }
  BridgeService service(
      {.queue = &parts->queue(),
       .intake = &parts->intake(),
       .plans = everything ? &plans : nullptr,
       .exports = exports.get(),
       .server = parts->server(),
       .retention = options.retention,
       .most_plan_time = 2 * std::chrono::seconds(options.plan.max_seconds) + std::chrono::hours(1),
       .log = LogLine});
  WakingSink sink(&parts->sink(), [&service] { service.Wake(); });
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<StorageReceiver> receiver,
                      StorageReceiver::Start(ReceiverOptionsOf(options), &parts->folder(), &sink));
  absl::PrintF("receiving on %s:%d\n", options.receiver.address, receiver->port());
  std::unique_ptr<ReviewServer> review;
  if (everything && options.has_review) {
    TF_ASSIGN_OR_RETURN(review,
                        ReviewServer::Start(ReviewOptionsOf(options, parts->access_audit()),
                                            &parts->queue(), [&service] { service.Wake(); }));
    absl::PrintF("review page on http://%s:%d/\n", options.review.address, review->port());
  }
  std::fflush(stdout);
  const SystemdWatchdog watchdog([&service](const std::function<void()>& answered) {
    const std::vector<std::string> stuck = service.Stuck();
    if (stuck.empty()) return answered();
    LogLine(true, absl::StrCat("a step takes too long: ", absl::StrJoin(stuck, ", "),
                               "; systemd restarts the bridge"));
  });
  NotifySystemdReady();
  WaitForEnd();
  NotifySystemdStopping();
  parts->Cancel();
  receiver->Stop();
  return absl::OkStatus();
}

}  // namespace

int RunBridge(const BridgeOptions& options, BridgeRunKind kind) {
  const absl::Status status = Serve(options, kind);
  if (status.ok()) {
    spdlog::info("done");
    return 0;
  }
  absl::FPrintF(stderr, "tissueform-pacs: %s\n", status.message());
  return 1;
}

}  // namespace tissueform
