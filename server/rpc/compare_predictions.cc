// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/compare_predictions.h"

#include <atomic>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/base/error_reason.h"
#include "core/base/status_macros.h"
#include "core/mechanics/deformation/comparison.h"
#include "core/mechanics/deformation/deformation_quality.h"
#include "proto/conversion/answer_conversion.h"
#include "proto/conversion/geometry_conversion.h"
#include "proto/conversion/mesh_conversion.h"
#include "proto/conversion/model_conversion.h"
#include "proto/conversion/prediction_conversion.h"
#include "proto/conversion/session_conversion.h"
#include "server/rpc/allowed_resource.h"
#include "server/rpc/calls/message_stream.h"
#include "server/rpc/prediction_record.h"
#include "server/rpc/single_answer.h"

namespace tissueform {
namespace {

struct ReadPrediction {
  v1::Prediction prediction;
  Positions positions;
};

// Blocks on the disk.
absl::StatusOr<ReadPrediction> Read(const std::string& id, PredictionStore* store) {
  TF_ASSIGN_OR_RETURN(const PredictionRecord record, store->Get(id));
  TF_ASSIGN_OR_RETURN(KeptPrediction kept, FromRecord(record));
  TF_ASSIGN_OR_RETURN(const std::string bytes, store->Positions(id));
  TF_ASSIGN_OR_RETURN(Positions positions, DecodePositions(bytes, record.vertex_count));
  return ReadPrediction{std::move(kept.prediction), std::move(positions)};
}

absl::Status NotComparable(absl::string_view why) {
  return WithReason(absl::FailedPreconditionError(why), ErrorReason::kNotComparable);
}

// Float32 of every number, as in what is kept: a model that answers the same has no difference.
Positions Rounded(const Positions& positions) { return positions.cast<float>().cast<double>(); }

std::string Encode(const Positions& positions, const VertexChoice& choice) {
  return EncodePositions(positions, choice, v1::POSITION_ENCODING_FLOAT32, positions).bytes;
}

class Comparison final : public MessageStream<v1::ComparePredictionsResponse> {
 public:
  Comparison(CallScope scope, CancelCall cancel, DeadlineTimer* timer,
             std::chrono::milliseconds patience, Access* access, SessionRegistry* registry,
             MeshCatalog* catalog, PredictionStore* store,
             const v1::ComparePredictionsRequest* request)
      : MessageStream(std::move(scope), std::move(cancel), timer, patience),
        access_(access),
        registry_(registry),
        catalog_(catalog),
        store_(store),
        request_(*request) {}

  void Start() {
    if (!scope().admission().ok()) {
      End(scope().admission());
      return;
    }
    registry_->pool().Post(Lane::kStore, [this] {
      const absl::Status status = ReadBoth();
      if (!status.ok()) End(status);
    });
  }

  void OnCancel() override {
    *cancelled_ = true;
    registry_->loader().CancelWait(cancelled_);
  }

 private:
  absl::Status ReadBoth() {
    TF_ASSIGN_OR_RETURN(
        const std::string one,
        AllowedPrediction(access_, &scope(), request_.prediction(), Permission::kRead));
    TF_ASSIGN_OR_RETURN(one_, Read(one, store_));
    if (!request_.vertices().has_skin()) {
      TF_ASSIGN_OR_RETURN(choice_, ToVertexChoice(request_.vertices(),
                                                  one_.prediction.vertex_count(), /*skin=*/{}));
    }
    v1::PredictionComparison& comparison = comparison_;
    comparison.set_prediction(one_.prediction.name());
    comparison.set_model(one_.prediction.model());
    if (request_.has_other_model()) {
      TF_ASSIGN_OR_RETURN(const std::string session, ParseSessionName(one_.prediction.session()));
      TF_RETURN_IF_ERROR(
          access_->CheckSessionAccess(scope().principal(), session, Permission::kRead).status());
      AskModel();
      return absl::OkStatus();
    }
    if (!request_.has_other_prediction()) {
      return absl::InvalidArgumentError("set other_prediction or other_model");
    }
    TF_ASSIGN_OR_RETURN(const std::string id, ParsePredictionName(request_.other_prediction()));
    TF_RETURN_IF_ERROR(
        access_->CheckPredictionAccess(scope().principal(), id, Permission::kRead).status());
    TF_ASSIGN_OR_RETURN(ReadPrediction other, Read(id, store_));
    if (other.prediction.mesh() != one_.prediction.mesh()) {
      return NotComparable(
          "the predictions have different meshes, whose vertices do not correspond; compare two "
          "of one mesh");
    }
    comparison.set_other_prediction(other.prediction.name());
    comparison.set_other_model(other.prediction.model());
    *comparison.mutable_other_summary() = other.prediction.summary();
    *comparison.mutable_other_quality() = other.prediction.quality();
    PostCompare(std::move(other.positions));
    return absl::OkStatus();
  }

  void AskModel() {
    FindSingleAnswer(
        registry_, {one_.prediction.session(), one_.prediction.poses(), request_.other_model()},
        cancelled_, [this](const Session& session) { return CheckSame(session); },
        [this](const absl::StatusOr<SingleAnswer>& answer) {
          if (!answer.ok()) {
            End(answer.status());
            return;
          }
          if (request_.vertices().has_skin()) {
            choice_ = {.all = false, .vertices = answer->session->mesh().skin};
          }
          comparison_.set_other_model(ToProto(answer->model));
          *comparison_.mutable_other_summary() = ToSummaryProto(answer->deformation, answer->model);
          *comparison_.mutable_other_quality() = ToProto(
              MeasureDeformation(answer->session->mesh().mesh, answer->deformation.positions));
          PostCompare(Rounded(answer->deformation.positions));
        });
  }

  absl::Status CheckSame(const Session& session) const {
    if (MeshName(session.mesh().sha256) == one_.prediction.mesh() &&
        RecipeSha256(session) == one_.prediction.recipe_sha256()) {
      return absl::OkStatus();
    }
    return NotComparable(
        "the session's mesh, regions or stiffness changed since the prediction "
        "was created; "
        "create the prediction again");
  }

  // Sorting a million distances takes its time.
  void PostCompare(Positions other) {
    registry_->pool().Post(Lane::kBatch, [this, other = std::move(other)] { Compare(other); });
  }

  void Compare(const Positions& other) {
    if (const absl::Status measured = Measure(other); !measured.ok()) {
      End(measured);
      return;
    }
    one_.positions.resize(0, 3);
    Send([this](v1::ComparePredictionsResponse* message) { return NextMessage(message); });
  }

  absl::Status Measure(const Positions& other) {
    if (request_.vertices().has_skin() && choice_.all) TF_RETURN_IF_ERROR(ChooseSkin());
    TF_ASSIGN_OR_RETURN(const Eigen::VectorXd all, VertexDistances(one_.positions, other));
    const Eigen::VectorXd distances = choice_.all ? all : Eigen::VectorXd(all(choice_.vertices));
    if (distances.size() > 0) {
      Eigen::Index worst = 0;
      distances.maxCoeff(&worst);
      *comparison_.mutable_distances() =
          ToProto(SummarizeDistances({distances.begin(), distances.end()}));
      comparison_.mutable_distances()->set_worst_vertex(choice_.all ? worst
                                                                    : choice_.vertices[worst]);
    }
    if (request_.differences()) differences_ = Encode(other - one_.positions, choice_);
    return absl::OkStatus();
  }

  // Reading a mesh takes its time, too. Of a stream's selection: the same vertices.
  absl::Status ChooseSkin() {
    TF_ASSIGN_OR_RETURN(const std::string sha256, ParseMeshName(one_.prediction.mesh()));
    TF_ASSIGN_OR_RETURN(const std::shared_ptr<const StoredMesh> mesh, catalog_->Load(sha256));
    TF_ASSIGN_OR_RETURN(choice_,
                        ToVertexChoice(request_.vertices(), mesh->mesh.num_vertices(), mesh->skin));
    return absl::OkStatus();
  }

  bool NextMessage(v1::ComparePredictionsResponse* message) {
    if (!comparison_sent_) {
      comparison_sent_ = true;
      *message->mutable_comparison() = std::move(comparison_);
      return true;
    }
    return NextChunk(differences_, &offset_, message->mutable_differences());
  }

  Access* const access_;
  SessionRegistry* const registry_;
  MeshCatalog* const catalog_;
  PredictionStore* const store_;
  const v1::ComparePredictionsRequest& request_;
  const std::shared_ptr<std::atomic<bool>> cancelled_ = std::make_shared<std::atomic<bool>>(false);
  ReadPrediction one_;
  VertexChoice choice_;
  v1::PredictionComparison comparison_;
  std::string differences_;
  size_t offset_ = 0;
  bool comparison_sent_ = false;
};

}  // namespace

grpc::ServerWriteReactor<v1::ComparePredictionsResponse>* StartComparison(
    CallScope scope, grpc::CallbackServerContext* context, DeadlineTimer* timer,
    std::chrono::milliseconds patience, Access* access, SessionRegistry* registry,
    MeshCatalog* catalog, PredictionStore* store, const v1::ComparePredictionsRequest* request) {
  auto* call = new Comparison(std::move(scope), CancelOf(context), timer, patience, access,
                              registry, catalog, store, request);
  call->Start();
  return call;
}

}  // namespace tissueform
