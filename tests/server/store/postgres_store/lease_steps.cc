// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/server/store/postgres_store/lease_steps.h"

#include <algorithm>

#include "absl/strings/str_cat.h"

namespace tissueform::testing {
namespace {

const char* NameOf(LeaseAction action) {
  switch (action) {
    case LeaseAction::kAcquire:
      return "acquires";
    case LeaseAction::kRenew:
      return "renews";
    case LeaseAction::kAcquireLate:
      return "acquires, later than it asked";
    case LeaseAction::kRenewLate:
      return "renews, later than it asked";
    case LeaseAction::kAcquireSlowly:
      return "acquires, and hears of it later";
    case LeaseAction::kRenewSlowly:
      return "renews, and hears of it later";
    case LeaseAction::kRelease:
      return "releases";
    case LeaseAction::kCommit:
      return "commits";
    case LeaseAction::kCommitOld:
      return "commits under its last epoch";
    case LeaseAction::kDelete:
      return "deletes";
    case LeaseAction::kMakeAgain:
      return "it is made again";
    case LeaseAction::kWait:
      return "time passes";
  }
  return "";
}

std::string ToWords(const LeaseStep& step) {
  if (step.action == LeaseAction::kWait || step.action == LeaseAction::kMakeAgain) {
    return NameOf(step.action);
  }
  return absl::StrCat(step.server == 0 ? "A " : "B ", NameOf(step.action));
}

}  // namespace

LeaseSteps PromptLeaseSteps() {
  LeaseSteps steps = {{LeaseAction::kWait, 0}, {LeaseAction::kMakeAgain, 0}};
  for (const LeaseAction action :
       {LeaseAction::kAcquire, LeaseAction::kRenew, LeaseAction::kRelease, LeaseAction::kCommit,
        LeaseAction::kCommitOld, LeaseAction::kDelete}) {
    for (const int server : {0, 1}) steps.push_back({action, server});
  }
  return steps;
}

LeaseSteps AllLeaseSteps() {
  LeaseSteps steps = PromptLeaseSteps();
  for (const LeaseAction action : {LeaseAction::kAcquireLate, LeaseAction::kRenewLate,
                                   LeaseAction::kAcquireSlowly, LeaseAction::kRenewSlowly}) {
    for (const int server : {0, 1}) steps.push_back({action, server});
  }
  return steps;
}

std::string ToString(const LeaseSteps& steps) {
  std::string words;
  for (const LeaseStep& step : steps) absl::StrAppend(&words, ToWords(step), "; ");
  return words;
}

LeaseServers::LeaseServers(LeaseWorld* world)
    : world_(world),
      leases_{SlowLeases(world, 0), SlowLeases(world, 1)},
      given_{world->FirstEpoch()} {
  for (size_t server : {0, 1}) {
    keepers_[server] = std::make_unique<LeaseKeeper>(
        &leases_[server], LeaseKeeper::Options{.clock = [world] { return world->Now(); }},
        [this, server](const SessionLease&) { until_[server].reset(); });
  }
}

std::string LeaseServers::Take(const LeaseStep& step) {
  const std::string answer = TakeOne(step);  // before it is asked who may answer
  return absl::StrCat(ToWords(step), ": ", answer, MayAnswer(0) ? " A" : " -",
                      MayAnswer(1) ? "B" : "-");
}

std::string LeaseServers::TakeOne(const LeaseStep& step) {
  const auto server = static_cast<size_t>(step.server);
  switch (step.action) {
    case LeaseAction::kAcquire:
      return Acquire(server);
    case LeaseAction::kRenew:
      return Renew(server);
    case LeaseAction::kAcquireLate:
      world_->DelayNext(kLeaseWait);
      return Acquire(server);
    case LeaseAction::kRenewLate:
      world_->DelayNext(kLeaseWait);
      return Renew(server);
    case LeaseAction::kAcquireSlowly:
      leases_[server].SlowNext(kLeaseWait);
      return Acquire(server);
    case LeaseAction::kRenewSlowly:
      leases_[server].SlowNext(kLeaseWait);
      return Renew(server);
    case LeaseAction::kRelease:
      until_[server].reset();
      return keepers_[server]->Release(world_->session()).ToString();
    case LeaseAction::kCommit:
      return Commit(step.server, EpochOf(step.server));
    case LeaseAction::kCommitOld:
      if (last_epochs_[server] == 0) return "has none";
      return Commit(step.server, last_epochs_[server]);
    case LeaseAction::kDelete:
      return Delete(step.server);
    case LeaseAction::kMakeAgain:
      return MakeAgain();
    case LeaseAction::kWait:
      world_->Wait(kLeaseWait);
      return "";
  }
  return "";
}

std::string LeaseServers::Renew(size_t server) {
  const auto asked = world_->Now();
  const absl::Status status = keepers_[server]->Renew().status();
  if (until_[server].has_value()) {
    until_[server] = asked + LeaseOptions().duration - LeaseOptions().margin;
  }
  return status.ToString();
}

std::string LeaseServers::Acquire(size_t server) {
  const absl::StatusOr<LeaseAnswer> answer = keepers_[server]->Acquire(world_->session());
  if (!answer.ok()) return absl::StatusCodeToString(answer.status().code());
  if (!answer->mine) return absl::StrCat("held by ", answer->node);
  const bool held_before =
      until_[server].has_value() && last_epochs_[server] == answer->lease.epoch;
  last_epochs_[server] = answer->lease.epoch;
  until_[server] = answer->lease.answers_until;
  return held_before ? "holds it" : Given(answer->lease.epoch);
}

std::string LeaseServers::Given(int64_t epoch) {
  if (epoch <= given_.back()) return "an epoch that is not greater than all before";
  given_.push_back(epoch);
  return absl::StrCat("the ", NameOf(epoch), " epoch");
}

std::string LeaseServers::NameOf(int64_t epoch) const {
  const auto found = std::find(given_.begin(), given_.end(), epoch);
  return found == given_.end() ? "unknown" : absl::StrCat(found - given_.begin() + 1, ".");
}

std::string LeaseServers::Commit(int server, std::optional<int64_t> epoch) {
  if (!epoch.has_value()) return "may not";
  if (!world_->Commit(*epoch)) return absl::StrCat("refused under the ", NameOf(*epoch));
  writes_.push_back({server, *epoch, given_.back()});
  return absl::StrCat("kept under the ", NameOf(*epoch));
}

std::string LeaseServers::Delete(int server) {
  const std::optional<int64_t> epoch = EpochOf(server);
  if (!epoch.has_value()) return "may not";
  if (!world_->Delete(*epoch)) return absl::StrCat("refused under the ", NameOf(*epoch));
  exists_ = false;
  until_[static_cast<size_t>(server)].reset();
  keepers_[static_cast<size_t>(server)]->Forget(world_->session());
  return "gone";
}

std::string LeaseServers::MakeAgain() {
  if (exists_) return "is there";
  exists_ = true;
  return Given(world_->MakeAgain());
}

std::string LeaseServers::Knowledge(std::chrono::steady_clock::time_point now) const {
  std::string words;
  for (const size_t server : {0, 1}) {
    // An old epoch is as bad as an older one.
    const char* behind = last_epochs_[server] == 0               ? "none"
                         : last_epochs_[server] == given_.back() ? "newest"
                                                                 : "old";
    const int64_t left =
        !until_[server].has_value()
            ? -99
            : std::max<int64_t>(
                  std::chrono::milliseconds((*until_[server] - now) / std::chrono::milliseconds(1))
                      .count(),
                  -1);
    absl::StrAppend(&words, behind, " ", left, " ");
  }
  return words;
}

}  // namespace tissueform::testing
