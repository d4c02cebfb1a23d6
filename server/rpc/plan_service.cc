// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/plan_service.h"

#include <algorithm>
#include <atomic>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"

#include "core/base/cancellation.h"
#include "core/base/status_macros.h"
#include "core/mechanics/plan_fitting/fit_problem.h"
#include "core/mechanics/plan_fitting/plan_fit.h"
#include "core/mechanics/prepared_answers/create_response.h"
#include "proto/conversion/fit_conversion.h"
#include "proto/conversion/geometry_conversion.h"
#include "proto/conversion/model_conversion.h"
#include "server/rpc/allowed_resource.h"

namespace tissueform {
namespace {

// Far below what a target means.
constexpr double kPreparedToleranceMm = 0.002;

// A session's model as who fits asks for it; on the session's strand only.
class SessionModel final : public Deformer {
 public:
  SessionModel(Session* session, DeformationModel model) : session_(*session), model_(model) {}

  absl::StatusOr<Deformation> Deform(absl::Span<const HandlePose> poses,
                                     const DeformControl& control) override {
    return session_.Solve(model_, poses, control);
  }
  const PreparationSummary& preparation() const override { return session_.preparation(); }

 private:
  Session& session_;
  const DeformationModel model_;
};

absl::StatusOr<std::vector<HandlePose>> StartOf(const v1::FitRequest& request,
                                                const ConstraintSet& constraints) {
  if (request.poses().empty()) return std::vector<HandlePose>(constraints.handles().size());
  TF_ASSIGN_OR_RETURN(std::vector<HandlePose> poses, ToPoses(request.poses(), constraints));
  if (std::any_of(poses.begin(), poses.end(), [](const HandlePose& p) { return p.scale != 1; })) {
    return absl::InvalidArgumentError("a pose has a scale other than 1; leave scales out");
  }
  return poses;
}

// One Fit call. Deletes itself when gRPC is done with it.
class FitCall : public grpc::ServerUnaryReactor {
 public:
  FitCall(CallScope scope, SessionRegistry* registry, const v1::FitRequest* request,
          v1::FitResponse* response)
      : scope_(std::move(scope)), registry_(registry), request_(*request), response_(*response) {}

  void Start(Access* access) {
    if (!scope_.admission().ok()) {
      End(scope_.admission());
      return;
    }
    registry_->pool().Post(Lane::kLeases,
                           [this, access] { EndUnlessOk([&] { return Begin(access); }); });
  }

  void OnCancel() override {
    *cancelled_ = true;
    registry_->loader().CancelWait(cancelled_);
  }

  void OnDone() override { delete this; }

 private:
  // Every step posts the next one as the last thing it does: the call may be over at once.
  template <typename Step>
  void EndUnlessOk(const Step& step) {
    if (const absl::Status status = step(); !status.ok()) End(status);
  }

  absl::Status Begin(Access* access) {
    TF_ASSIGN_OR_RETURN(const std::string id,
                        AllowedSession(access, &scope_, request_.session(), Permission::kWrite));
    TF_ASSIGN_OR_RETURN(wanted_, ToFitRequest(request_));
    registry_->loader().Open(
        id, cancelled_, [this](absl::StatusOr<std::shared_ptr<Session>> session) {
          if (!session.ok()) {
            End(session.status());
            return;
          }
          session_ = *std::move(session);
          session_->pool().Post(Lane::kSolves,
                                [this] { EndUnlessOk([this] { return Resolve(); }); });
        });
    return absl::OkStatus();
  }

  absl::Status Resolve() {
    TF_ASSIGN_OR_RETURN(model_, ToModel(request_.model(), session_->model()));
    const ConstraintSet& constraints = session_->constraints();
    if (!HasPreparedAnswers(model_, session_->gradient_field(), constraints)) {
      return absl::InvalidArgumentError(absl::StrCat("the model has no prepared answers; choose ",
                                                     ModelsWithPreparedAnswers(constraints)));
    }
    TF_ASSIGN_OR_RETURN(const std::vector<HandlePose> start,
                        StartOf(request_, session_->constraints()));
    TF_ASSIGN_OR_RETURN(problem_,
                        ResolveFit(wanted_, session_->mesh().mesh, session_->mesh().skin_facets,
                                   session_->constraints(), start));
    session_->making_strand().Post(Lane::kBatch,
                                   [this] { EndUnlessOk([this] { return Prepare(); }); });
    return absl::OkStatus();
  }

  absl::Status Prepare() {
    const ResponseRequest answers{.model = model_,
                                  .vertices = FitVertices(problem_),
                                  .tolerance_mm = kPreparedToleranceMm,
                                  .max_rotation_rad = LargestFitRotation(problem_)};
    TF_ASSIGN_OR_RETURN(claim_, session_->PrepareResponse(answers, cancellation_));
    const auto search = [this] { End(Search()); };
    if (request_.verify()) {
      session_->strand().Post(session_->LaneOf(model_), search);
    } else {
      session_->pool().Post(Lane::kSolves, search);
    }
    return absl::OkStatus();
  }

  absl::Status Search() {
    TF_RETURN_IF_ERROR(cancellation_.Check());
    const std::shared_ptr<const SharedResponse> answers = claim_->Get();
    if (answers == nullptr) {
      return session_->evicted() ? absl::UnavailableError("the session was evicted; try again")
                                 : absl::NotFoundError("the session was deleted; create it again");
    }
    SessionModel model(session_.get(), model_);
    TF_ASSIGN_OR_RETURN(
        const PlanFit fit,
        FitPlan(
            problem_, session_->mesh().mesh, session_->constraints(), *answers->response,
            {.full_model = request_.verify() ? &model : nullptr, .cancellation = cancellation_}));
    response_ = ToProto(problem_, fit);
    return absl::OkStatus();
  }

  void End(const absl::Status& outcome) {
    claim_.reset();
    session_.reset();
    Finish(scope_.End(outcome));
  }

  CallScope scope_;
  SessionRegistry* const registry_;
  const v1::FitRequest& request_;
  v1::FitResponse& response_;
  const std::shared_ptr<std::atomic<bool>> cancelled_ = std::make_shared<std::atomic<bool>>(false);
  const Cancellation cancellation_{[flag = cancelled_] { return flag->load(); }};

  // Set step by step; one thread at a time.
  FitRequest wanted_;
  std::shared_ptr<Session> session_;
  DeformationModel model_ = DeformationModel::kGradientField;
  FitProblem problem_;
  std::shared_ptr<PreparedAnswersRef> claim_;
};

}  // namespace

grpc::ServerUnaryReactor* PlanService::Fit(grpc::CallbackServerContext* context,
                                           const v1::FitRequest* request,
                                           v1::FitResponse* response) {
  auto* call = new FitCall(CallScope(context, "PlanService.Fit", CallKind::kNewWork, gate_),
                           registry_, request, response);
  call->Start(access_);
  return call;
}

}  // namespace tissueform
