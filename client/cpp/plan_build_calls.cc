// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/plan_build_calls.h"

#include <algorithm>
#include <iterator>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"

#include "client/cpp/call_canceller.h"
#include "client/cpp/client_call.h"
#include "client/cpp/session_call.h"
#include "client/cpp/upload_attempts.h"
#include "core/base/error_reason.h"
#include "core/base/random_id.h"
#include "core/base/status_macros.h"
#include "core/mesh/payload/sha256.h"

namespace tissueform {
namespace {

// Well below the server's limit of 1 MiB a chunk.
constexpr size_t kFileChunkBytes = size_t{512} << 10;
// For how long a build is looked for whose server is away: one that starts again goes on with it.
constexpr std::chrono::seconds kWatchPatience{60};

class FileUpload {
 public:
  FileUpload(v1::PlanBuildService::Stub* stub, absl::string_view bytes, const std::string& suffix,
             std::chrono::milliseconds call_deadline, const UploadOptions& options,
             const Cancellation& cancellation)
      : stub_(stub),
        bytes_(bytes),
        total_bytes_(static_cast<int64_t>(bytes.size())),
        call_deadline_(call_deadline),
        options_(options),
        cancellation_(cancellation) {
    header_.set_sha256(Sha256Hex({bytes}));
    header_.set_total_bytes(total_bytes_);
    header_.set_suffix(suffix);
  }

  absl::StatusOr<v1::BuildFile> Run() {
    return RunUploadAttempts(
        options_, farthest_, [this](bool again) { return TryOnce(again); },
        [this](const absl::Status& status) { return MayRepeat(status); });
  }

 private:
  absl::StatusOr<v1::BuildFile> TryOnce(bool again) {
    TF_RETURN_IF_ERROR(cancellation_.Check());
    TF_ASSIGN_OR_RETURN(const v1::BuildFile known, Find());
    const int64_t from = known.committed_bytes();
    if (!known.name().empty() && from == total_bytes_) return known;
    if (options_.on_resumed && (again || from > 0)) options_.on_resumed(from, total_bytes_);
    farthest_ = std::max(farthest_, from);
    return SendFrom(from);
  }

  // What has come to the server; empty: nothing, or of another size, which the server drops.
  absl::StatusOr<v1::BuildFile> Find() const {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + call_deadline_);
    v1::GetBuildFileRequest request;
    request.set_name(absl::StrCat("buildFiles/", header_.sha256()));
    v1::BuildFile found;
    const absl::Status status = EndOfCall(stub_->GetBuildFile(&context, request, &found));
    if (absl::IsNotFound(status) || absl::IsDataLoss(status)) return v1::BuildFile();
    TF_RETURN_IF_ERROR(status);
    return found.total_bytes() == total_bytes_ ? found : v1::BuildFile();
  }

  absl::StatusOr<v1::BuildFile> SendFrom(int64_t from) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + call_deadline_);
    const CallCanceller canceller(cancellation_, &context);
    v1::BuildFile sent;
    const auto writer = stub_->UploadBuildFile(&context, &sent);
    v1::UploadBuildFileRequest request;
    *request.mutable_header() = header_;
    // Where a write fails the server has ended the call, often with a reason: Finish has it.
    if (writer->Write(request) && WriteFrom(from, writer.get())) writer->WritesDone();
    TF_RETURN_IF_ERROR(EndOfCall(writer->Finish(), canceller.was_cancelled()));
    if (sent.name().empty()) return AnswerWasLost();
    return sent;
  }

  bool WriteFrom(int64_t from, grpc::ClientWriter<v1::UploadBuildFileRequest>* writer) {
    v1::UploadBuildFileRequest request;
    int64_t at = from;
    do {
      const absl::string_view data = bytes_.substr(static_cast<size_t>(at), kFileChunkBytes);
      v1::BuildFileChunk* chunk = request.mutable_chunk();
      chunk->set_write_offset(at);
      chunk->set_data(data.data(), data.size());
      at += static_cast<int64_t>(data.size());
      chunk->set_finish_write(at == total_bytes_);
      if (!writer->Write(request)) return false;
      farthest_ = std::max(farthest_, at);
      if (options_.on_progress) options_.on_progress(at, total_bytes_);
    } while (at < total_bytes_);
    return true;
  }

  // Damage on the way is repaired by sending again, once.
  bool MayRepeat(const absl::Status& status) {
    if (absl::IsResourceExhausted(status) || cancellation_.requested()) return false;
    if (absl::IsDataLoss(status)) return !std::exchange(damaged_before_, true);
    return IsTransient(status) || absl::IsAborted(status) || absl::IsDeadlineExceeded(status) ||
           HasReason(status, ErrorReason::kChunkOutOfPlace);
  }

  v1::PlanBuildService::Stub* const stub_;
  const absl::string_view bytes_;
  const int64_t total_bytes_;
  const std::chrono::milliseconds call_deadline_;
  const UploadOptions& options_;
  const Cancellation& cancellation_;
  v1::BuildFileHeader header_;
  int64_t farthest_ = -1;  // byte that was there, or was given to a connection
  bool damaged_before_ = false;
};

// A file that comes in parts, attempt after attempt.
class PartsRead {
 public:
  template <typename Response, typename Reader>
  grpc::Status Take(const Reader& reader) {
    *this = PartsRead();
    for (Response part; reader->Read(&part);) {
      is_contiguous_ = is_contiguous_ && part.offset() == static_cast<int64_t>(bytes_.size());
      total_bytes_ = part.total_bytes();
      bytes_ += part.data();
    }
    return reader->Finish();
  }

  absl::StatusOr<std::string> Whole(absl::string_view what) {
    if (is_contiguous_ && total_bytes_ == static_cast<int64_t>(bytes_.size())) {
      return std::move(bytes_);
    }
    return absl::DataLossError(absl::StrCat("the server sent a damaged ", what, "; try again"));
  }

 private:
  std::string bytes_;
  int64_t total_bytes_ = 0;
  bool is_contiguous_ = true;
};

}  // namespace

bool IsDone(const v1::PlanBuild& build) {
  return build.state() == v1::PLAN_BUILD_STATE_SUCCEEDED ||
         build.state() == v1::PLAN_BUILD_STATE_FAILED ||
         build.state() == v1::PLAN_BUILD_STATE_CANCELLED;
}

PlanBuildCalls::PlanBuildCalls(const std::shared_ptr<grpc::Channel>& channel,
                               std::chrono::milliseconds call_deadline, SessionRoutes* routes)
    : call_deadline_(call_deadline),
      routes_(routes),
      stub_(v1::PlanBuildService::NewStub(channel)) {}

std::chrono::system_clock::time_point PlanBuildCalls::Deadline() const {
  return std::chrono::system_clock::now() + call_deadline_;
}

absl::Status PlanBuildCalls::Call(
    const std::function<grpc::Status(grpc::ClientContext*)>& attempt) {
  return RunSessionCall(routes_, "", CallRepeat::kAlways, Deadline(), attempt);
}

template <typename Request, typename Answer>
absl::StatusOr<Answer> PlanBuildCalls::Ask(UnaryMethod<Request, Answer> method,
                                           const Request& request) {
  Answer answer;
  TF_RETURN_IF_ERROR(Call([&](grpc::ClientContext* context) {
    return (stub_.get()->*method)(context, request, &answer);
  }));
  return answer;
}

absl::StatusOr<v1::BuildFile> PlanBuildCalls::Upload(absl::string_view bytes,
                                                     const std::string& suffix,
                                                     const UploadOptions& options,
                                                     const Cancellation& cancellation) {
  return FileUpload(stub_.get(), bytes, suffix, call_deadline_, options, cancellation).Run();
}

absl::StatusOr<v1::PlanBuild> PlanBuildCalls::Create(v1::CreatePlanBuildRequest request) {
  if (request.request_id().empty()) request.set_request_id(RandomId());
  return Ask(&Service::CreatePlanBuild, request);
}

absl::StatusOr<v1::PlanBuild> PlanBuildCalls::Get(const std::string& name) {
  v1::GetPlanBuildRequest request;
  request.set_name(name);
  return Ask(&Service::GetPlanBuild, request);
}

absl::StatusOr<v1::PlanBuild> PlanBuildCalls::Cancel(const std::string& name) {
  v1::CancelPlanBuildRequest request;
  request.set_name(name);
  return Ask(&Service::CancelPlanBuild, request);
}

absl::Status PlanBuildCalls::Delete(const std::string& name) {
  v1::DeletePlanBuildRequest request;
  request.set_name(name);
  google::protobuf::Empty response;
  return RunDeletion(routes_, "", Deadline(), [&](grpc::ClientContext* context) {
    return stub_->DeletePlanBuild(context, request, &response);
  });
}

absl::Status PlanBuildCalls::WatchOnce(const std::string& name,
                                       const std::function<void(const v1::PlanBuild&)>& on_change,
                                       const Cancellation& cancellation, v1::PlanBuild* last,
                                       bool* came) {
  grpc::ClientContext context;
  routes_->AddHeaders("", &context);
  const CallCanceller canceller(cancellation, &context);
  v1::WatchPlanBuildRequest request;
  request.set_name(name);
  const auto reader = stub_->WatchPlanBuild(&context, request);
  while (reader->Read(last)) {
    *came = true;
    if (on_change) on_change(*last);
  }
  TF_RETURN_IF_ERROR(EndOfCall(reader->Finish(), canceller.was_cancelled()));
  return IsDone(*last) ? absl::OkStatus()
                       : absl::UnavailableError("the server ended the watch before the build");
}

absl::StatusOr<v1::PlanBuild> PlanBuildCalls::Wait(
    const std::string& name, const std::function<void(const v1::PlanBuild&)>& on_change,
    const Cancellation& cancellation) {
  using Clock = std::chrono::steady_clock;
  Clock::time_point give_up = Clock::now() + kWatchPatience;
  Backoff backoff(Backoff::Options{});
  v1::PlanBuild last;
  while (true) {
    bool came = false;
    const absl::Status ended = WatchOnce(name, on_change, cancellation, &last, &came);
    if (ended.ok()) return last;
    TF_RETURN_IF_ERROR(cancellation.Check());
    if (!IsTransient(ended)) return ended;
    if (came) {
      give_up = Clock::now() + kWatchPatience;
      backoff.Reset();
    }
    const std::chrono::milliseconds wait = backoff.Next();
    if (Clock::now() + wait > give_up) return ended;
    std::this_thread::sleep_for(wait);
  }
}

absl::StatusOr<v1::BuildDraft> PlanBuildCalls::CreateDraft(
    const v1::CreateBuildDraftRequest& request) {
  return Ask(&Service::CreateBuildDraft, request);
}

absl::StatusOr<v1::BuildDraft> PlanBuildCalls::GetDraft(const std::string& name) {
  v1::GetBuildDraftRequest request;
  request.set_name(name);
  return Ask(&Service::GetBuildDraft, request);
}

absl::StatusOr<std::vector<v1::BuildDraft>> PlanBuildCalls::ListDrafts() {
  std::vector<v1::BuildDraft> drafts;
  v1::ListBuildDraftsRequest request;
  do {
    TF_ASSIGN_OR_RETURN(v1::ListBuildDraftsResponse page, Ask(&Service::ListBuildDrafts, request));
    std::move(page.mutable_drafts()->begin(), page.mutable_drafts()->end(),
              std::back_inserter(drafts));
    request.set_page_token(page.next_page_token());
  } while (!request.page_token().empty());
  return drafts;
}

absl::Status PlanBuildCalls::DeleteDraft(const std::string& name) {
  v1::DeleteBuildDraftRequest request;
  request.set_name(name);
  google::protobuf::Empty response;
  return RunDeletion(routes_, "", Deadline(), [&](grpc::ClientContext* context) {
    return stub_->DeleteBuildDraft(context, request, &response);
  });
}

absl::StatusOr<std::string> PlanBuildCalls::ReadDraft(const std::string& name,
                                                      const Cancellation& cancellation) {
  v1::ReadBuildDraftRequest request;
  request.set_name(name);
  PartsRead read;
  TF_RETURN_IF_ERROR(Call([&](grpc::ClientContext* context) {
    const CallCanceller canceller(cancellation, context);
    return read.Take<v1::ReadBuildDraftResponse>(stub_->ReadBuildDraft(context, request));
  }));
  return read.Whole("CT");
}

absl::StatusOr<std::string> PlanBuildCalls::ReadFile(const std::string& name,
                                                     const std::string& path,
                                                     const Cancellation& cancellation) {
  v1::ReadPlanBuildFileRequest request;
  request.set_name(name);
  request.set_path(path);
  PartsRead read;
  TF_RETURN_IF_ERROR(Call([&](grpc::ClientContext* context) {
    const CallCanceller canceller(cancellation, context);
    return read.Take<v1::ReadPlanBuildFileResponse>(stub_->ReadPlanBuildFile(context, request));
  }));
  return read.Whole(path);
}

}  // namespace tissueform
