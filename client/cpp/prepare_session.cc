// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/prepare_session.h"

#include <algorithm>
#include <memory>
#include <optional>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "grpcpp/client_context.h"
#include "grpcpp/completion_queue.h"
#include "grpcpp/support/async_stream.h"

#include "client/cpp/client_call.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr std::chrono::milliseconds kAsk{100};

// One call on a queue of its own, so that waiting for a message can be interrupted.
class Call {
 public:
  explicit Call(const PreparationWait& wait) : wait_(wait) {}
  ~Call() {
    queue_.Shutdown();
    void* tag = nullptr;
    bool ok = false;
    while (queue_.Next(&tag, &ok)) {
    }
  }
  Call(const Call&) = delete;
  Call& operator=(const Call&) = delete;

  // For headers and the deadline before, for the reply's metadata after Run.
  grpc::ClientContext* context() { return &context_; }

  absl::StatusOr<v1::Session> Run(v1::SessionService::Stub* stub,
                                  const v1::PrepareSessionRequest& request) {
    std::optional<v1::Session> session;
    reader_ = stub->AsyncPrepareSession(&context_, request, &queue_, this);
    bool open = Wait();
    while (open) {
      v1::PrepareSessionResponse response;
      reader_->Read(&response, this);
      open = Wait();
      if (!open) break;
      if (response.has_session()) session = std::move(*response.mutable_session());
      if (response.has_progress() && wait_.on_progress) wait_.on_progress(response.progress());
    }
    grpc::Status status;
    reader_->Finish(&status, this);
    Wait();
    TF_RETURN_IF_ERROR(EndOfCall(status, was_cancelled_));
    if (session.has_value()) return *std::move(session);
    return absl::InternalError(
        "the preparation ended without a session; the server has another version");
  }

 private:
  // Until what was begun has ended; false when there is no more to come.
  bool Wait() {
    while (true) {
      if (wait_.cancellation.requested()) {
        was_cancelled_ = true;
        context_.TryCancel();
      }
      void* tag = nullptr;
      bool ok = false;
      const auto next = queue_.AsyncNext(&tag, &ok, std::chrono::system_clock::now() + kAsk);
      if (next == grpc::CompletionQueue::GOT_EVENT) return ok;
      if (next == grpc::CompletionQueue::SHUTDOWN) return false;
    }
  }

  const PreparationWait& wait_;
  grpc::ClientContext context_;
  bool was_cancelled_ = false;
  grpc::CompletionQueue queue_;
  std::unique_ptr<grpc::ClientAsyncReader<v1::PrepareSessionResponse>> reader_;
};

// Until another attempt is due. Errors: Cancelled.
absl::Status WaitUntil(std::chrono::system_clock::time_point due, const PreparationWait& wait) {
  for (auto now = std::chrono::system_clock::now(); now < due;
       now = std::chrono::system_clock::now()) {
    TF_RETURN_IF_ERROR(wait.cancellation.Check());
    std::this_thread::sleep_for(std::min<std::chrono::system_clock::duration>(due - now, kAsk));
  }
  return absl::OkStatus();
}

std::string StageText(v1::PreparationStage stage) {
  switch (stage) {
    case v1::PREPARATION_STAGE_READING_MESH:
      return "reading the mesh";
    case v1::PREPARATION_STAGE_WAITING:
      return "waiting for its turn";
    case v1::PREPARATION_STAGE_ASSEMBLING:
      return "assembling";
    case v1::PREPARATION_STAGE_ORDERING:
      return "ordering";
    case v1::PREPARATION_STAGE_FACTORISING:
      return "factorising";
    case v1::PREPARATION_STAGE_RESPONSES:
      return "preparing the model";
    case v1::PREPARATION_STAGE_KEEPING:
      return "storing the session";
    case v1::PREPARATION_STAGE_ANSWERS:
      return "preparing answers";
    default:
      return "preparing";  // of a newer server
  }
}

}  // namespace

absl::StatusOr<v1::Session> WaitForSession(v1::SessionService::Stub* stub,
                                           const v1::PrepareSessionRequest& request,
                                           const PreparationRoute& route,
                                           const PreparationWait& wait) {
  SessionAttempts attempts(route.routes, route.session, route.repeat);
  while (true) {
    Call call(wait);
    call.context()->set_deadline(route.deadline);
    attempts.AddHeaders(call.context());
    absl::StatusOr<v1::Session> session = call.Run(stub, request);
    if (session.ok()) {
      route.routes->Remember(session->name(), NodeOf(*call.context()));
      return session;
    }
    TF_RETURN_IF_ERROR(wait.cancellation.Check());
    const auto pause = attempts.AfterError(session.status());
    const auto again = std::chrono::system_clock::now() + pause.value_or(kAsk);
    if (!pause.has_value() || again > route.deadline) return session;
    TF_RETURN_IF_ERROR(WaitUntil(again, wait));
  }
}

std::string ProgressText(const v1::PreparationProgress& progress) {
  std::string text = StageText(progress.stage());
  if (progress.steps() > 0) {
    absl::StrAppend(&text, ", ", progress.step(), " of ", progress.steps(), " columns");
  }
  return text;
}

}  // namespace tissueform
