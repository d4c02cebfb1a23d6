// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/single_answer.h"

#include <utility>

#include "core/base/cancellation.h"
#include "core/base/status_macros.h"
#include "proto/conversion/geometry_conversion.h"
#include "proto/conversion/model_conversion.h"
#include "proto/conversion/session_conversion.h"

namespace tissueform {
namespace {

absl::Status ClientHasCancelled() { return absl::CancelledError("the client canceled the call"); }

// Lives as long as one of its jobs waits or runs.
class Search : public std::enable_shared_from_this<Search> {
 public:
  Search(AnswerQuestion question, SessionLoader::CancelFlag cancelled, CheckSession check,
         AnswerCallback done)
      : question_(std::move(question)),
        cancelled_(std::move(cancelled)),
        check_(std::move(check)),
        done_(std::move(done)) {}

  void Start(SessionRegistry* registry) {
    const absl::StatusOr<std::string> id = ParseSessionName(question_.session);
    if (!id.ok()) {
      done_(id.status());
      return;
    }
    registry->loader().Open(
        *id, cancelled_,
        [self = shared_from_this()](absl::StatusOr<std::shared_ptr<Session>> session) {
          const absl::Status status =
              session.ok() ? self->TakeSession(*std::move(session)) : session.status();
          if (!status.ok()) self->done_(status);
        });
  }

 private:
  absl::Status TakeSession(std::shared_ptr<Session> session) {
    answer_.session = std::move(session);
    TF_ASSIGN_OR_RETURN(answer_.model, ToModel(question_.model, answer_.session->model()));
    // Before the poses, which a session that is not fit may not have the handles for.
    if (check_) TF_RETURN_IF_ERROR(check_(*answer_.session));
    TF_ASSIGN_OR_RETURN(answer_.poses, ToPoses(question_.poses, answer_.session->constraints()));
    if (answer_.session->HasModel(answer_.model)) {
      PostSolve();
    } else {
      answer_.session->making_strand().Post(Lane::kBatch,
                                            [self = shared_from_this()] { self->MakeModel(); });
    }
    return absl::OkStatus();
  }

  void MakeModel() {
    const absl::Status made = answer_.session->PrepareModel(answer_.model, cancellation_);
    if (made.ok()) {
      PostSolve();
    } else {
      done_(made);
    }
  }

  void PostSolve() {
    Session& session = *answer_.session;
    session.strand().Post(session.LaneOf(answer_.model), [self = shared_from_this()] {
      const absl::Status solved = self->Solve();
      if (solved.ok()) {
        self->done_(std::move(self->answer_));
      } else {
        self->done_(solved);
      }
    });
  }

  absl::Status Solve() {
    if (cancellation_.requested()) return ClientHasCancelled();
    DeformControl control;
    control.on_progress = [this](const Deformation& /*so_far*/) {
      return !cancellation_.requested();
    };
    TF_ASSIGN_OR_RETURN(answer_.deformation,
                        answer_.session->Solve(answer_.model, answer_.poses, control));
    if (answer_.deformation.summary.cancelled) return ClientHasCancelled();
    return answer_.session->CheckHeld();
  }

  const AnswerQuestion question_;
  const SessionLoader::CancelFlag cancelled_;
  const CheckSession check_;
  const AnswerCallback done_;
  const Cancellation cancellation_{[flag = cancelled_] { return flag->load(); }};
  SingleAnswer answer_;
};

}  // namespace

void FindSingleAnswer(SessionRegistry* registry, AnswerQuestion question,
                      SessionLoader::CancelFlag cancelled, CheckSession check,
                      AnswerCallback done) {
  std::make_shared<Search>(std::move(question), std::move(cancelled), std::move(check),
                           std::move(done))
      ->Start(registry);
}

}  // namespace tissueform
