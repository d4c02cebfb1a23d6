// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "grpcpp/channel.h"

#include "client/cpp/access_calls.h"
#include "client/cpp/case_calls.h"
#include "client/cpp/connection_options.h"
#include "client/cpp/deform_stream.h"
#include "client/cpp/export_calls.h"
#include "client/cpp/mesh_upload.h"
#include "client/cpp/plan_build_calls.h"
#include "client/cpp/prediction_calls.h"
#include "client/cpp/prepare_session.h"
#include "client/cpp/prepared_evaluator.h"
#include "client/cpp/session_call.h"
#include "client/cpp/session_routes.h"
#include "client/cpp/token_file.h"
#include "client/cpp/watch_stream.h"
#include "core/mesh/payload/mesh_payload.h"
#include "core/mesh/tet_mesh.h"
#include "proto/conversion/geometry_conversion.h"
#include "proto/conversion/model_conversion.h"
#include "proto/conversion/session_conversion.h"
#include "tissueform/v1/deform_service.grpc.pb.h"
#include "tissueform/v1/mesh_service.grpc.pb.h"
#include "tissueform/v1/server_info.grpc.pb.h"
#include "tissueform/v1/session_service.grpc.pb.h"

namespace tissueform {

// A connection to a tissueform-server. Calls block; each has a deadline. Errors carry the server's
// code and message (proto/tissueform/v1 says which), besides Unavailable and DeadlineExceeded.
// Calls that concern a session carry its id in a header, by which a proxy can route them.
//
// Behind one name may stand a cluster. Then a call goes to the server that has the session, and is
// tried again for kFailoverPatience where that one is away: reads, and what is done once when it
// is done twice (CallRepeat::kAlways), after any loss; UpdateSession with an etag, sessions with an
// id of their own, predictions and exports without a request_id, and UpdateExport only where a
// server says that it has done nothing. Of what a call deletes NOT_FOUND after a loss says that it
// was deleted.
//
// Thread-safe.
class TissueformClient {
 public:
  struct Options {
    std::chrono::milliseconds connect_deadline{5'000};
    std::chrono::milliseconds call_deadline{600'000};
    // A TCP connection of its own. Otherwise clients of one process and address share one, over
    // which their frames follow each other.
    bool own_connection = false;
    // Encryption, and who one is.
    ConnectionOptions connection = {};
  };

  // `address` is HOST:PORT. Connects directly: proxies of the environment are not used.
  //
  // Errors: InvalidArgument (no port), Unavailable (no answer within the deadline); those
  // of MakeServerChannel and OpenTokenOf.
  static absl::StatusOr<std::unique_ptr<TissueformClient>> Connect(const std::string& address,
                                                                   const Options& options);

  // What the server is and takes.
  absl::StatusOr<v1::ServerInfo> GetServerInfo();

  // Uploads the mesh with its arrays, unless the server has it: see SendMesh in mesh_upload.h.
  //
  // Errors: InvalidArgument also when an array has not one value per tet; that of the first
  // question when the server is away from the beginning.
  absl::StatusOr<v1::Mesh> UploadMesh(const TetMesh& mesh,
                                      const std::vector<CellArray>& cell_arrays,
                                      const UploadOptions& options = {});
  // The same of a payload as it is.
  absl::StatusOr<v1::Mesh> UploadMesh(const MeshPayloadView& payload,
                                      const UploadOptions& options = {});
  // How much of a mesh that is not complete has come to the server.
  absl::StatusOr<v1::QueryUploadResponse> QueryUpload(const std::string& name);
  absl::StatusOr<v1::Mesh> GetMesh(const std::string& name);
  // All of them, page after page.
  absl::StatusOr<std::vector<v1::Mesh>> ListMeshes();
  absl::Status DeleteMesh(const std::string& name);

  // In a cluster, without a request_id of the caller's, under one that is made here.
  absl::StatusOr<v1::Session> CreateSession(const SessionRequest& request);
  absl::StatusOr<v1::Session> GetSession(const std::string& name);
  // All of them, page after page.
  absl::StatusOr<std::vector<v1::Session>> ListSessions();
  // The session is prepared again when this returns. Errors: Aborted also when request.etag is not
  // the session's.
  absl::StatusOr<v1::Session> UpdateSession(const v1::UpdateSessionRequest& request);
  // CreateSession, UpdateSession, or a session that is to be in memory, with word of how far it is,
  // and cancelled at once. Errors: theirs; Cancelled.
  absl::StatusOr<v1::Session> PrepareSession(const v1::PrepareSessionRequest& request,
                                             const PreparationWait& wait);
  absl::Status DeleteSession(const std::string& name);

  // `model` is the session's own when unspecified.
  absl::StatusOr<v1::DeformOnceResponse> DeformOnce(
      const std::string& session, absl::Span<const NamedPose> poses,
      const AnswerVertices& vertices = {},
      v1::DeformationModel model = v1::DEFORMATION_MODEL_UNSPECIFIED,
      v1::PositionEncoding encoding = v1::POSITION_ENCODING_FLOAT32);
  // For what the parameters above leave out: ranges of the material.
  absl::StatusOr<v1::DeformOnceResponse> DeformOnce(const v1::DeformOnceRequest& request);

  // The stream has no deadline. No `patience`: for who tries again himself.
  absl::StatusOr<std::unique_ptr<DeformStream>> OpenStream(
      const std::string& session, const DeformStream::Options& options,
      std::chrono::milliseconds patience = kFailoverPatience);

  // The prepared answers that a stream with these options answers from, to evaluate them here;
  // `session` is what the server says of it. Errors: those of PreparedEvaluator::Fetch;
  // InvalidArgument (options.prepared is left out).
  absl::StatusOr<std::unique_ptr<PreparedEvaluator>> FetchPreparedAnswers(
      const v1::Session& session, const DeformStream::Options& options);

  // Follows what others drag. The watch has no deadline.
  absl::StatusOr<std::unique_ptr<WatchStream>> Watch(
      const std::string& session, const WatchStream::Options& options,
      std::chrono::milliseconds patience = kFailoverPatience);

  // Answers that the server keeps.
  PredictionCalls& predictions() { return predictions_; }

  // What planners open.
  CaseCalls& cases() { return cases_; }

  // Plans that the server builds.
  PlanBuildCalls& plan_builds() { return plan_builds_; }

  // What is to go to the PACS.
  ExportCalls& exports() { return exports_; }

  // Who may do what.
  AccessCalls& access() { return access_; }

 private:
  TissueformClient(const std::shared_ptr<grpc::Channel>& channel, std::shared_ptr<TokenFile> token,
                   const Options& options);

  std::chrono::system_clock::time_point Deadline() const {
    return std::chrono::system_clock::now() + options_.call_deadline;
  }
  absl::StatusOr<v1::Session> CreateSession(const v1::CreateSessionRequest& request,
                                            CallRepeat repeat);
  absl::Status Call(const std::string& session, CallRepeat repeat,
                    const std::function<grpc::Status(grpc::ClientContext*)>& attempt) {
    return RunSessionCall(&routes_, session, repeat, Deadline(), attempt);
  }

  const Options options_;
  const std::shared_ptr<TokenFile> token_;  // null: none
  SessionRoutes routes_;                    // self-synchronised
  const std::unique_ptr<v1::MeshService::Stub> meshes_;
  const std::unique_ptr<v1::SessionService::Stub> sessions_;
  const std::unique_ptr<v1::DeformService::Stub> deform_;
  const std::unique_ptr<v1::ServerInfoService::Stub> server_info_;
  PredictionCalls predictions_;
  CaseCalls cases_;
  PlanBuildCalls plan_builds_;
  ExportCalls exports_;
  AccessCalls access_;
};

}  // namespace tissueform
