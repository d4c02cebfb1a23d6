// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/prepared_answers_stream.h"

#include <algorithm>
#include <atomic>
#include <memory>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/cancellation.h"
#include "core/base/status_macros.h"
#include "core/mechanics/answer_evaluator/answer_bytes.h"
#include "core/mesh/payload/sha256.h"
#include "proto/conversion/model_conversion.h"
#include "server/rpc/allowed_resource.h"
#include "server/rpc/calls/message_stream.h"
#include "server/rpc/stream_answers.h"

namespace tissueform {
namespace {

constexpr size_t kAnswerChunkBytes = size_t{1} << 20;

// As the first message of a stream would ask.
v1::DeformConfiguration ConfigurationOf(const v1::GetPreparedAnswersRequest& request) {
  v1::DeformConfiguration configuration;
  configuration.set_session(request.session());
  *configuration.mutable_vertices() = request.vertices();
  configuration.set_model(request.model());
  *configuration.mutable_prepared() = request.prepared();
  return configuration;
}

// One GetPreparedAnswers call.
class PreparedAnswersStream final : public MessageStream<v1::GetPreparedAnswersResponse> {
 public:
  PreparedAnswersStream(CallScope scope, CancelCall cancel, DeadlineTimer* timer,
                        const ServiceLimits& limits, SessionRegistry* registry,
                        const v1::GetPreparedAnswersRequest& request)
      : MessageStream(std::move(scope), std::move(cancel), timer, limits.upload_silence),
        limits_(limits),
        registry_(registry),
        request_(request) {}

  void Start(Access* access) {
    if (!scope().admission().ok()) {
      End(scope().admission());
      return;
    }
    registry_->pool().Post(Lane::kLeases,
                           [this, access] { EndUnlessOk([&] { return Begin(access); }); });
  }

  void OnCancel() override {
    *cancelled_ = true;
    registry_->loader().CancelWait(cancelled_);
  }

 private:
  // Every step posts the next one as the last thing it does: the call may be over at once.
  template <typename Step>
  void EndUnlessOk(const Step& step) {
    if (const absl::Status status = step(); !status.ok()) End(status);
  }

  absl::Status Begin(Access* access) {
    TF_ASSIGN_OR_RETURN(const std::string id,
                        AllowedSession(access, &scope(), request_.session(), Permission::kWrite));
    if (!request_.has_prepared()) {
      return absl::InvalidArgumentError("`prepared` is missing; set it as for the stream");
    }
    TF_ASSIGN_OR_RETURN(wanted_, ReadStreamRequest(ConfigurationOf(request_), limits_));
    registry_->loader().Open(id, cancelled_,
                             [this](absl::StatusOr<std::shared_ptr<Session>> session) {
                               EndUnlessOk([&] { return Choose(std::move(session)); });
                             });
    return absl::OkStatus();
  }

  absl::Status Choose(absl::StatusOr<std::shared_ptr<Session>> session) {
    TF_RETURN_IF_ERROR(session.status());
    // Reading ranges is work, and so is a selection of many vertices.
    Session& opened = **session;
    opened.making_strand().Post(Lane::kBatch, [this, session = *std::move(session)]() mutable {
      EndUnlessOk([&] { return Prepare(std::move(session)); });
    });
    return absl::OkStatus();
  }

  absl::Status Prepare(std::shared_ptr<Session> session) {
    TF_ASSIGN_OR_RETURN(const std::shared_ptr<const StreamConfiguration> configuration,
                        ReadConfiguration(wanted_, std::move(session)));
    TF_ASSIGN_OR_RETURN(
        const std::shared_ptr<PreparedAnswersRef> claim,
        configuration->session->PrepareResponse(*configuration->response, cancellation_));
    const std::shared_ptr<const SharedResponse> shared = claim->Get();
    if (shared == nullptr) return absl::NotFoundError("the session was deleted");
    TF_RETURN_IF_ERROR(Write(*shared));
    TF_RETURN_IF_ERROR(cancellation_.Check());
    Send([this](v1::GetPreparedAnswersResponse* message) { return NextMessage(message); });
    return absl::OkStatus();
  }

  // The bytes, and what the header says of them.
  absl::Status Write(const SharedResponse& shared) {
    PortableAnswers answers = shared.response->Describe();
    if (shared.band != nullptr) shared.band->Describe(&answers);
    bytes_ = WriteAnswers(answers);
    const auto size = static_cast<int64_t>(bytes_.size());
    const int64_t most = std::min<int64_t>(limits_.max_prepared_answer_bytes, kMaxAnswerBytes);
    if (size > most) {
      return absl::ResourceExhaustedError(absl::StrCat("the prepared answers have ", size,
                                                       " bytes; the server sends at most ", most,
                                                       ": request fewer vertices"));
    }
    if (request_.read_offset() < 0 || request_.read_offset() > size) {
      return absl::InvalidArgumentError(absl::StrCat("read_offset is ", request_.read_offset(),
                                                     "; the size of the prepared answers is ", size,
                                                     " bytes"));
    }
    offset_ = static_cast<size_t>(request_.read_offset());
    header_.set_model(ToProto(shared.request.model));
    header_.set_total_bytes(size);
    header_.set_sha256(Sha256Hex({bytes_}));
    header_.set_vertex_count(shared.response->num_vertices());
    header_.set_terms(shared.response->num_terms());
    header_.set_terms_before(shared.response->num_terms_before());
    return absl::OkStatus();
  }

  bool NextMessage(v1::GetPreparedAnswersResponse* message) {
    if (!header_sent_) {
      header_sent_ = true;
      *message->mutable_header() = std::move(header_);
      return true;
    }
    if (offset_ >= bytes_.size()) return false;
    const size_t size = std::min(kAnswerChunkBytes, bytes_.size() - offset_);
    message->mutable_chunk()->set_offset(static_cast<int64_t>(offset_));
    message->mutable_chunk()->set_data(bytes_.data() + offset_, size);
    offset_ += size;
    return true;
  }

  const ServiceLimits limits_;
  SessionRegistry* const registry_;
  const v1::GetPreparedAnswersRequest& request_;
  const std::shared_ptr<std::atomic<bool>> cancelled_ = std::make_shared<std::atomic<bool>>(false);
  const Cancellation cancellation_{[flag = cancelled_] { return flag->load(); }};

  // Set step by step; one thread at a time.
  StreamRequest wanted_;
  std::string bytes_;
  v1::PreparedAnswersHeader header_;
  size_t offset_ = 0;
  bool header_sent_ = false;
};

}  // namespace

grpc::ServerWriteReactor<v1::GetPreparedAnswersResponse>* StartPreparedAnswers(
    CallScope scope, grpc::CallbackServerContext* context, DeadlineTimer* timer,
    const ServiceLimits& limits, Access* access, SessionRegistry* registry,
    const v1::GetPreparedAnswersRequest* request) {
  auto* call = new PreparedAnswersStream(std::move(scope), CancelOf(context), timer, limits,
                                         registry, *request);
  call->Start(access);
  return call;
}

}  // namespace tissueform
