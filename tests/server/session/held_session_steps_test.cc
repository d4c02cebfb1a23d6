// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// Two servers that share a session, and all that may happen to it there, in any order.

#include <algorithm>
#include <array>
#include <deque>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gtest/gtest.h"

#include "core/base/error_reason.h"
#include "tests/server/session/node.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using testing::IsOk;
using testing::Node;
using testing::SharedSessions;

enum class Action {
  kOpen,
  kRenew,
  kReportLost,  // what has run out is reported as lost, without asking the store
  kCommit,      // of the newest drag
  kCommitOld,   // of the oldest one, as a server does that was stopped
  kUpdate,
  kDelete,
  kMakeAgain,  // under the same name, when it was deleted
  kEvict,
  kWait,
};
constexpr std::array kNames = {"open",   "renew",  "tell",       "commit", "commit old",
                               "update", "delete", "make again", "evict",  "wait"};
// After two of them a lease has run out.
constexpr int kWaitSeconds = 6;

struct Step {
  Action action = Action::kWait;
  size_t node = 0;
};

std::vector<Step> AllSteps() {
  std::vector<Step> steps = {{Action::kWait, 0}};
  for (size_t node = 0; node < 2; ++node) {
    for (int action = 0; action < static_cast<int>(Action::kWait); ++action) {
      steps.push_back({static_cast<Action>(action), node});
    }
  }
  return steps;
}

std::string ToString(const std::vector<Step>& steps) {
  std::string text;
  for (const Step& step : steps) {
    absl::StrAppend(&text, kNames[static_cast<size_t>(step.action)],
                    step.action == Action::kWait ? ""
                    : step.node == 0             ? " a"
                                                 : " b",
                    "; ");
  }
  return text;
}

class HeldSessionStepsTest : public ::testing::Test {
 protected:
  HeldSessionStepsTest() {
    // All that is made below shares what these have prepared.
    for (const size_t node : {0, 1}) EXPECT_THAT(node_(node).Create(absl::StrCat(node)), IsOk());
  }

  Node& node_(size_t node) { return node == 0 ? a_ : b_; }

  void Begin() {
    id_ = absl::StrCat("s", ++last_);
    kept_z_ = 0;
    deleted_ = false;
    drags_ = {};
    ended_ = {};
    Make(0);
  }

  void Make(size_t node) {
    node_(node).registry.sync().OnDeleted(id_);  // it has heard that the one before is gone
    const Node::Opened created = node_(node).Create(id_);
    ASSERT_THAT(created, IsOk());
    drags_[node].push_back(*created);
    kept_z_ = 0;
    deleted_ = false;
  }

  void Take(const Step& step) {
    Node& node = node_(step.node);
    std::vector<std::shared_ptr<Session>>& drags = drags_[step.node];
    switch (step.action) {
      case Action::kOpen: {
        const Node::Opened opened = node.Open(id_);
        if (opened.ok()) drags.push_back(*opened);
        EXPECT_TRUE(opened.ok() || IsRefusal(opened.status())) << opened.status();
        break;
      }
      case Action::kRenew:
        for (const std::string& lost : node.ownership.Renew()) node.registry.Lost(lost);
        break;
      case Action::kReportLost:
        for (const std::string& lost : node.ownership.TakeEnded()) node.registry.Lost(lost);
        break;
      case Action::kCommit:
        if (!drags.empty()) Commit(&node, drags.back());
        break;
      case Action::kCommitOld:
        node.ownership.set_stopped(true);
        if (!drags.empty()) Commit(&node, drags.front());
        node.ownership.set_stopped(false);
        break;
      case Action::kUpdate: {
        const absl::Status updated = node.Update(id_);
        EXPECT_TRUE(updated.ok() || IsRefusal(updated)) << updated;
        break;
      }
      case Action::kDelete: {
        const absl::Status gone = node.Delete(id_);
        EXPECT_TRUE(gone.ok() || IsRefusal(gone)) << gone;
        EXPECT_FALSE(gone.ok() && deleted_) << "it was gone already";
        deleted_ |= gone.ok();
        if (!gone.ok()) break;
        for (const auto& of_node : drags_) ended_.insert(of_node.begin(), of_node.end());
        break;
      }
      case Action::kMakeAgain:
        if (deleted_) Make(step.node);
        break;
      case Action::kEvict:
        node.EvictAll();
        break;
      case Action::kWait:
        shared_.Wait(kWaitSeconds);
        break;
    }
    node.Settle();
  }

  void Commit(Node* node, const std::shared_ptr<Session>& session) {
    const double z = ++z_;
    const absl::Status committed = node->Commit(session, z);
    EXPECT_TRUE(committed.ok() || IsRefusal(committed)) << committed;
    EXPECT_FALSE(committed.ok() && ended_.contains(session)) << "of a session that was deleted";
    if (committed.ok()) kept_z_ = z;
  }

  // Moved, or deleted. What was deleted and made again has moved, for who held it before.
  bool IsRefusal(const absl::Status& status) const {
    return HasReason(status, ErrorReason::kSessionMoved) ||
           (deleted_ && HasReason(status, ErrorReason::kSessionNotFound));
  }

  // Whether one of its drags may show a frame.
  bool MayAnswer(size_t node) const {
    for (const auto& drag : drags_[node]) {
      if (drag->CheckHeld().ok()) return true;
    }
    return false;
  }

  void Check() {
    EXPECT_FALSE(MayAnswer(0) && MayAnswer(1)) << "frames of both";
    for (const auto& drag : ended_) EXPECT_FALSE(drag->CheckHeld().ok()) << "it was deleted";
    EXPECT_EQ(shared_.stale_writes(), 0);
    const std::optional<SharedSessions::Lease> lease = shared_.Find(id_);
    EXPECT_EQ(lease.has_value(), !deleted_);
    if (!lease.has_value()) return;
    for (const size_t node : {0, 1}) {
      if (!MayAnswer(node)) continue;
      EXPECT_EQ(lease->node, node == 0 ? "a" : "b");
      EXPECT_GT(lease->until, shared_.now());
    }
    const auto view = a_.Look(id_);
    ASSERT_THAT(view, IsOk());
    const std::vector<HandlePose>& poses = view->record.last_poses;
    EXPECT_EQ(poses.empty() ? 0 : poses[0].translation_mm.z(), kept_z_) << "a commit was lost";
  }

  // What may decide about what happens next.
  std::string State() {
    std::string state;
    const std::optional<SharedSessions::Lease> lease = shared_.Find(id_);
    if (lease.has_value()) {
      absl::StrAppend(
          &state, lease->node, ",",
          std::max(0, (lease->until - shared_.now() + kWaitSeconds - 1) / kWaitSeconds));
    }
    for (const size_t node : {0, 1}) {
      Node& server = node_(node);
      absl::StrAppend(&state, "; ", server.registry.table().Knows(id_),
                      server.registry.table().Find(id_).ok(),
                      server.ownership.EpochOf(id_).has_value());
      std::set<std::string> drags;
      for (const auto& drag : drags_[node]) {
        drags.insert(absl::StrCat(drag->CheckHeld().ok(), drag->moved(), drag->evicted(),
                                  drag->updated(), ended_.contains(drag),
                                  lease.has_value() && lease->epoch == drag->epoch()));
      }
      for (const std::string& drag : drags) absl::StrAppend(&state, " ", drag);
      if (!drags_[node].empty()) {
        absl::StrAppend(&state, " last", drags_[node].back()->CheckHeld().ok());
      }
    }
    return state;
  }

  void End() {
    drags_ = {};
    ended_ = {};
    shared_.Wait(2 * SharedSessions::kLeaseSeconds);
    if (!deleted_) {
      EXPECT_THAT(a_.Delete(id_), IsOk());
    }
    for (const size_t node : {0, 1}) {
      for (const std::string& lost : node_(node).ownership.TakeEnded()) {
        node_(node).registry.Lost(lost);
      }
      node_(node).registry.sync().OnDeleted(id_);
      node_(node).Settle();
      EXPECT_FALSE(node_(node).registry.table().Knows(id_));
    }
  }

  SharedSessions shared_;
  Node a_{&shared_, "a"};
  Node b_{&shared_, "b"};
  int last_ = 0;
  double z_ = 0;
  // Of the session that is looked at.
  std::string id_;
  double kept_z_ = 0;
  bool deleted_ = false;
  std::array<std::vector<std::shared_ptr<Session>>, 2> drags_;
  std::set<std::shared_ptr<Session>> ended_;  // of sessions that were deleted
};

// All orders of three steps, and on from every state that there is, up to six.
TEST_F(HeldSessionStepsTest, NeverLetBothServersAnswerNorWriteUnderAnOldEpoch) {
  constexpr size_t kAllOrders = 2;
  constexpr size_t kDeepest = 6;
  const std::vector<Step> all = AllSteps();
  std::set<std::string> seen;
  std::deque<std::vector<Step>> to_do = {{}};
  int orders = 0;
  while (!to_do.empty() && !HasFailure()) {
    const std::vector<Step> before = to_do.front();
    to_do.pop_front();
    for (const Step& next : all) {
      std::vector<Step> steps = before;
      steps.push_back(next);
      SCOPED_TRACE(ToString(steps));
      Begin();
      for (const Step& step : steps) Take(step);
      Check();
      const bool is_new = seen.insert(State()).second;
      if (steps.size() < kDeepest && (is_new || steps.size() <= kAllOrders)) to_do.push_back(steps);
      End();
      ++orders;
    }
  }
  EXPECT_GT(orders, 3000);
  RecordProperty("orders", orders);
  RecordProperty("states", static_cast<int>(seen.size()));
}

}  // namespace
}  // namespace tissueform
