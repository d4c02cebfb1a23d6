// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/work/case_server.h"

#include <chrono>
#include <optional>
#include <thread>
#include <utility>

#include "client/cpp/server_channel.h"
#include "client/cpp/tissueform_client.h"
#include "client/pacs_bridge/work/material_band.h"
#include "core/base/mutex.h"
#include "core/base/status_macros.h"
#include "core/planning/case_file/case_reader.h"

namespace tissueform {
namespace {

// Nothing for so long (the server says something every 20 s) means that it is gone.
constexpr std::chrono::seconds kWatchSilence{70};

MeshPayloadView PayloadOfCase(const CaseMesh& mesh) {
  return {.shape = {mesh.vertex_count, mesh.tet_count, mesh.cell_arrays},
          .segments = {mesh.payload}};
}

// Cancels a watch that was ended, or that has become silent, from a thread of its own.
class WatchEnd {
 public:
  WatchEnd(ExportWatchStream* watch, const Cancellation& cancelled)
      : watch_(watch), cancelled_(cancelled), thread_([this] { Run(); }) {}
  ~WatchEnd() {
    {
      MutexLock lock(mutex_);
      done_ = true;
    }
    changed_.NotifyAll();
    thread_.join();
  }
  WatchEnd(const WatchEnd&) = delete;
  WatchEnd& operator=(const WatchEnd&) = delete;

  void Heard() ABSL_LOCKS_EXCLUDED(mutex_) {
    MutexLock lock(mutex_);
    heard_ = Clock::now();
  }

 private:
  using Clock = std::chrono::steady_clock;

  void Run() ABSL_LOCKS_EXCLUDED(mutex_) {
    MutexLock lock(mutex_);
    while (!done_) {
      if (cancelled_.requested() || Clock::now() - heard_ > kWatchSilence) watch_->Cancel();
      changed_.WaitUntil(mutex_, Clock::now() + std::chrono::seconds(1));
    }
  }

  ExportWatchStream* const watch_;
  const Cancellation& cancelled_;

  Mutex mutex_;
  ConditionVariable changed_;
  bool done_ ABSL_GUARDED_BY(mutex_) = false;
  Clock::time_point heard_ ABSL_GUARDED_BY(mutex_) = Clock::now();

  std::thread thread_;
};

class ConnectedCaseServer final : public CaseServer {
 public:
  ConnectedCaseServer(std::string address, ConnectionOptions options, std::string project)
      : address_(std::move(address)), options_(std::move(options)), project_(std::move(project)) {}

  absl::StatusOr<std::string> Publish(const std::string& case_bytes,
                                      const std::string& title) override {
    TF_ASSIGN_OR_RETURN(const CaseFile contents, ParseCase(case_bytes));
    TF_ASSIGN_OR_RETURN(TissueformClient* const client, Client());
    TF_RETURN_IF_ERROR(client->UploadMesh(PayloadOfCase(contents.mesh)).status());
    TF_ASSIGN_OR_RETURN(const v1::Case made,
                        client->cases().Upload(case_bytes, title, {}, project_));
    return made.name();
  }

  absl::StatusOr<std::string> ReadCase(const std::string& name) override {
    TF_ASSIGN_OR_RETURN(TissueformClient* const client, Client());
    return client->cases().Read(name);
  }

  absl::StatusOr<ServedPrediction> ReadPrediction(const std::string& name) override {
    TF_ASSIGN_OR_RETURN(TissueformClient* const client, Client());
    ServedPrediction prediction;
    TF_ASSIGN_OR_RETURN(prediction.description, client->predictions().Get(name));
    TF_ASSIGN_OR_RETURN(prediction.positions, client->predictions().ReadPositions(name));
    return prediction;
  }

  absl::StatusOr<std::vector<double>> ReadBand(const CaseFile& contents,
                                               const v1::Prediction& prediction) override {
    TF_ASSIGN_OR_RETURN(TissueformClient* const client, Client());
    return AskMaterialBand(client, contents, prediction);
  }

  absl::StatusOr<std::string> SendDraft(const std::string& ct, const std::string& title,
                                        const std::string& recipe_json) override {
    TF_ASSIGN_OR_RETURN(TissueformClient* const client, Client());
    TF_ASSIGN_OR_RETURN(const v1::BuildFile file, client->plan_builds().Upload(ct, ".mha"));
    v1::CreateBuildDraftRequest request;
    request.set_ct(file.name());
    request.set_title(title);
    request.set_project(project_);
    request.set_recipe_json(recipe_json);
    TF_ASSIGN_OR_RETURN(const v1::BuildDraft draft, client->plan_builds().CreateDraft(request));
    return draft.name();
  }

  absl::StatusOr<std::vector<v1::BuildDraft>> ListDrafts() override {
    TF_ASSIGN_OR_RETURN(TissueformClient* const client, Client());
    return client->plan_builds().ListDrafts();
  }

  absl::Status RemoveDraft(const std::string& name) override {
    TF_ASSIGN_OR_RETURN(TissueformClient* const client, Client());
    return client->plan_builds().DeleteDraft(name);
  }

  absl::StatusOr<v1::Export> GetExport(const std::string& name) override {
    TF_ASSIGN_OR_RETURN(TissueformClient* const client, Client());
    return client->exports().Get(name);
  }

  absl::Status UpdateExport(const std::string& name, v1::ExportState state,
                            const std::string& detail, int stored_objects) override {
    TF_ASSIGN_OR_RETURN(TissueformClient* const client, Client());
    v1::UpdateExportRequest request;
    request.set_name(name);
    request.set_state(state);
    request.set_detail(detail);
    request.set_stored_objects(stored_objects);
    return client->exports().Update(request).status();
  }

  absl::Status WatchExports(const std::function<void(const v1::Export&)>& on_export,
                            const Cancellation& cancelled) override {
    TF_ASSIGN_OR_RETURN(TissueformClient* const client, Client());
    const std::unique_ptr<ExportWatchStream> watch = client->exports().Watch();
    WatchEnd end(watch.get(), cancelled);
    while (const std::optional<v1::WatchExportsResponse> heard = watch->Receive()) {
      end.Heard();
      if (heard->has_export_()) on_export(heard->export_());
    }
    return watch->Finish();
  }

 private:
  // Connects when it is first needed, so that a bridge may begin before its server.
  absl::StatusOr<TissueformClient*> Client() ABSL_LOCKS_EXCLUDED(mutex_) {
    MutexLock lock(mutex_);
    if (client_ == nullptr) {
      TF_ASSIGN_OR_RETURN(client_, TissueformClient::Connect(
                                       address_, {.own_connection = true, .connection = options_}));
    }
    return client_.get();
  }

  // Constant.
  const std::string address_;
  const ConnectionOptions options_;
  const std::string project_;

  Mutex mutex_;
  std::unique_ptr<TissueformClient> client_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace

absl::StatusOr<std::unique_ptr<CaseServer>> ConnectToCaseServer(const std::string& address,
                                                                const ConnectionOptions& options,
                                                                const std::string& project) {
  // What is wrong with the options is said now; the server may come later.
  TF_ASSIGN_OR_RETURN(const std::shared_ptr<TokenFile> token, OpenTokenOf(options));
  TF_RETURN_IF_ERROR(MakeServerChannel(address, options, token, grpc::ChannelArguments()).status());
  return std::unique_ptr<CaseServer>(
      std::make_unique<ConnectedCaseServer>(address, options, project));
}

}  // namespace tissueform
