// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <deque>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "grpcpp/server_context.h"
#include "grpcpp/support/status.h"

#include "core/base/error_reason.h"
#include "core/base/mutex.h"
#include "proto/conversion/session_conversion.h"
#include "tissueform/v1/case_service.grpc.pb.h"
#include "tissueform/v1/deform_service.grpc.pb.h"
#include "tissueform/v1/export_service.grpc.pb.h"
#include "tissueform/v1/prediction_service.grpc.pb.h"
#include "tissueform/v1/session_service.grpc.pb.h"

// The servers of a cluster behind one name, as the client library sees them.
namespace tissueform::testing {

inline constexpr char kSession[] = "sessions/0123456789abcdef";
inline constexpr char kOwnName[] = "one:1";

inline grpc::Status RefusalFor(grpc::StatusCode code, ErrorReason reason, const std::string& node) {
  google::rpc::ErrorInfo info;
  info.set_reason(std::string(ReasonName(reason)));
  info.set_domain("tissueform");
  if (!node.empty()) (*info.mutable_metadata())["node"] = node;
  google::rpc::Status details;
  details.set_code(code);
  details.add_details()->PackFrom(info);
  return {code, "refused", details.SerializeAsString()};
}
inline grpc::Status MovedTo(const std::string& node) {
  return RefusalFor(grpc::StatusCode::UNAVAILABLE, ErrorReason::kSessionMoved, node);
}

// What the servers of a cluster do behind one name: each call in its turn is answered as planned,
// and those beyond the plan well. Notes which server each call was meant for.
class Script {
 public:
  void Plan(std::vector<grpc::Status> answers) {
    MutexLock lock(mutex_);
    planned_.assign(answers.begin(), answers.end());
  }
  grpc::Status Take(grpc::ServerContext* context) {
    const auto node = context->client_metadata().find(kNodeHeader);
    if (says_name) context->AddInitialMetadata(kNodeHeader, kOwnName);
    MutexLock lock(mutex_);
    meant_.push_back(node == context->client_metadata().end()
                         ? "-"
                         : std::string(node->second.data(), node->second.size()));
    if (planned_.empty()) return grpc::Status::OK;
    const grpc::Status answer = planned_.front();
    planned_.pop_front();
    return answer;
  }
  std::vector<std::string> meant() const {
    MutexLock lock(mutex_);
    return meant_;
  }

  std::atomic<bool> says_name = true;

 private:
  mutable Mutex mutex_;
  std::deque<grpc::Status> planned_ ABSL_GUARDED_BY(mutex_);
  std::vector<std::string> meant_ ABSL_GUARDED_BY(mutex_);
};

class ScriptedSessions final : public v1::SessionService::Service {
 public:
  explicit ScriptedSessions(Script* script) : script_(script) {}

  grpc::Status CreateSession(grpc::ServerContext* context, const v1::CreateSessionRequest* request,
                             v1::Session* session) override {
    session->set_name(kSession);
    {
      MutexLock lock(mutex_);
      request_ids_.push_back(request->request_id());
    }
    return script_->Take(context);
  }
  grpc::Status GetSession(grpc::ServerContext* context, const v1::GetSessionRequest*,
                          v1::Session*) override {
    return script_->Take(context);
  }
  grpc::Status UpdateSession(grpc::ServerContext* context, const v1::UpdateSessionRequest*,
                             v1::Session*) override {
    return script_->Take(context);
  }
  grpc::Status DeleteSession(grpc::ServerContext* context, const v1::DeleteSessionRequest*,
                             google::protobuf::Empty*) override {
    return script_->Take(context);
  }
  std::vector<std::string> request_ids() const {
    MutexLock lock(mutex_);
    return request_ids_;
  }

 private:
  Script* const script_;
  mutable Mutex mutex_;
  std::vector<std::string> request_ids_ ABSL_GUARDED_BY(mutex_);
};

// Drags and watches: a stream that is answered well takes poses until its turn to end has come.
class ScriptedStreams final : public v1::DeformService::Service {
 public:
  explicit ScriptedStreams(Script* script) : script_(script) {}

  grpc::Status Deform(
      grpc::ServerContext* context,
      grpc::ServerReaderWriter<v1::DeformResponse, v1::DeformRequest>* stream) override {
    v1::DeformRequest request;
    stream->Read(&request);
    if (grpc::Status refusal = script_->Take(context); !refusal.ok()) return refusal;
    v1::DeformResponse response;
    response.mutable_started();
    stream->Write(response);
    while (stream->Read(&request)) {
      if (!request.has_pose()) continue;
      {
        MutexLock lock(mutex_);
        poses_.push_back(absl::StrCat(request.pose().sequence(),
                                      request.pose().commit() ? " to be committed" : ""));
      }
      if (request.pose().commit() && commits) {
        response.mutable_notice()->mutable_committed()->set_sequence(request.pose().sequence());
        stream->Write(response);
      }
      response.mutable_frame()->set_sequence(request.pose().sequence());
      stream->Write(response);
      if (std::optional<grpc::Status> end = TakeEnd(); end.has_value()) return *end;
    }
    return grpc::Status::OK;
  }

  grpc::Status Watch(grpc::ServerContext* context, const v1::WatchRequest*,
                     grpc::ServerWriter<v1::WatchResponse>* stream) override {
    if (grpc::Status refusal = script_->Take(context); !refusal.ok()) return refusal;
    v1::WatchResponse response;
    response.mutable_started()->set_watch("watches/0");
    stream->Write(response);
    uint64_t number = 0;
    for (const v1::WatchOrigin origin : TakeOrigins()) {
      response.mutable_frame()->set_number(++number);
      response.mutable_frame()->set_origin(origin);
      stream->Write(response);
    }
    return TakeEnd().value_or(grpc::Status::OK);
  }

  grpc::Status AcknowledgeWatch(grpc::ServerContext* context, const v1::AcknowledgeWatchRequest*,
                                google::protobuf::Empty*) override {
    return script_->Take(context);
  }

  // What the watches show that come next; those beyond the plan a frame each.
  void PlanOrigins(std::vector<std::vector<v1::WatchOrigin>> origins) {
    MutexLock lock(mutex_);
    origins_.assign(origins.begin(), origins.end());
  }
  // How the streams end that come next, each after its first frame; watches after their last.
  void PlanEnds(std::vector<grpc::Status> ends) {
    MutexLock lock(mutex_);
    ends_.assign(ends.begin(), ends.end());
  }
  std::vector<std::string> poses() const {
    MutexLock lock(mutex_);
    return poses_;
  }

  std::atomic<bool> commits = true;  // commits are kept, and the client receives a notice

 private:
  std::vector<v1::WatchOrigin> TakeOrigins() {
    MutexLock lock(mutex_);
    if (origins_.empty()) return {v1::WATCH_ORIGIN_DRAG};
    const std::vector<v1::WatchOrigin> origins = origins_.front();
    origins_.pop_front();
    return origins;
  }
  std::optional<grpc::Status> TakeEnd() {
    MutexLock lock(mutex_);
    if (ends_.empty()) return std::nullopt;
    const grpc::Status end = ends_.front();
    ends_.pop_front();
    return end;
  }

  Script* const script_;
  mutable Mutex mutex_;
  std::deque<grpc::Status> ends_ ABSL_GUARDED_BY(mutex_);
  std::deque<std::vector<v1::WatchOrigin>> origins_ ABSL_GUARDED_BY(mutex_);
  std::vector<std::string> poses_ ABSL_GUARDED_BY(mutex_);
};

inline constexpr char kCaseBytes[] = "a case";

class ScriptedCases final : public v1::CaseService::Service {
 public:
  explicit ScriptedCases(Script* script) : script_(script) {}

  grpc::Status GetCase(grpc::ServerContext* context, const v1::GetCaseRequest*,
                       v1::Case*) override {
    return script_->Take(context);
  }
  grpc::Status ListCases(grpc::ServerContext* context, const v1::ListCasesRequest*,
                         v1::ListCasesResponse*) override {
    return script_->Take(context);
  }
  grpc::Status DeleteCase(grpc::ServerContext* context, const v1::DeleteCaseRequest*,
                          google::protobuf::Empty*) override {
    return script_->Take(context);
  }
  // The first call that is to fail brings nothing, the next ones a byte.
  grpc::Status ReadCase(grpc::ServerContext* context, const v1::ReadCaseRequest* request,
                        grpc::ServerWriter<v1::ReadCaseResponse>* stream) override {
    const grpc::Status end = script_->Take(context);
    if (!end.ok() && !failed_.exchange(true)) return end;
    const int64_t offset = request->read_offset();
    v1::ReadCaseResponse response;
    response.set_offset(offset);
    response.set_data(std::string(kCaseBytes).substr(offset, end.ok() ? std::string::npos : 1));
    stream->Write(response);
    return end;
  }

 private:
  Script* const script_;
  std::atomic<bool> failed_ = false;
};

class ScriptedPredictions final : public v1::PredictionService::Service {
 public:
  explicit ScriptedPredictions(Script* script) : script_(script) {}

  grpc::Status DeletePrediction(grpc::ServerContext* context, const v1::DeletePredictionRequest*,
                                google::protobuf::Empty*) override {
    return script_->Take(context);
  }

 private:
  Script* const script_;
};

// Hears of exports until its turn to end has come.
class ScriptedExports final : public v1::ExportService::Service {
 public:
  explicit ScriptedExports(Script* script) : script_(script) {}

  grpc::Status CreateExport(grpc::ServerContext* context, const v1::CreateExportRequest*,
                            v1::Export*) override {
    return script_->Take(context);
  }
  grpc::Status GetExport(grpc::ServerContext* context, const v1::GetExportRequest*,
                         v1::Export*) override {
    return script_->Take(context);
  }
  grpc::Status ListExports(grpc::ServerContext* context, const v1::ListExportsRequest*,
                           v1::ListExportsResponse*) override {
    return script_->Take(context);
  }
  grpc::Status UpdateExport(grpc::ServerContext* context, const v1::UpdateExportRequest*,
                            v1::Export*) override {
    return script_->Take(context);
  }
  grpc::Status DeleteExport(grpc::ServerContext* context, const v1::DeleteExportRequest*,
                            google::protobuf::Empty*) override {
    return script_->Take(context);
  }

  grpc::Status WatchExports(grpc::ServerContext* context, const v1::WatchExportsRequest*,
                            grpc::ServerWriter<v1::WatchExportsResponse>* stream) override {
    const grpc::Status end = script_->Take(context);
    stream->Write({});
    return end;
  }

 private:
  Script* const script_;
};

}  // namespace tissueform::testing
