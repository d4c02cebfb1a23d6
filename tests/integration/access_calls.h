// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "grpcpp/channel.h"
#include "grpcpp/client_context.h"

#include "server/access/auth/authenticator.h"
#include "tests/integration/access_world.h"
#include "tests/integration/service_test.h"
#include "tissueform/v1/access_service.grpc.pb.h"
#include "tissueform/v1/case_service.grpc.pb.h"
#include "tissueform/v1/deform_service.grpc.pb.h"
#include "tissueform/v1/export_service.grpc.pb.h"
#include "tissueform/v1/mesh_service.grpc.pb.h"
#include "tissueform/v1/plan_service.grpc.pb.h"
#include "tissueform/v1/prediction_service.grpc.pb.h"
#include "tissueform/v1/server_info.grpc.pb.h"
#include "tissueform/v1/session_service.grpc.pb.h"

namespace tissueform::testing {

// "Bearer NAME" is NAME, in the project "p"; names in capitals are publishers, too, and "ADMIN" is
// an admin, "BRIDGE" a bridge.
class NamedCallers final : public Authenticator {
 public:
  absl::StatusOr<Authenticated> Authenticate(const Credentials& credentials) override;
  absl::Status IsStillAuthorized(const Authenticated& authenticated) override;
};

// The headers of a call by this caller.
std::unique_ptr<grpc::ClientContext> ContextOf(const AccessWorld::Caller& caller);

// All services of a server.
struct Stubs {
  explicit Stubs(const std::shared_ptr<grpc::Channel>& channel);

  std::unique_ptr<v1::AccessService::Stub> access;
  std::unique_ptr<v1::CaseService::Stub> cases;
  std::unique_ptr<v1::DeformService::Stub> deform;
  std::unique_ptr<v1::ExportService::Stub> exports;
  std::unique_ptr<v1::MeshService::Stub> meshes;
  std::unique_ptr<v1::PlanService::Stub> plans;
  std::unique_ptr<v1::PredictionService::Stub> predictions;
  std::unique_ptr<v1::ServerInfoService::Stub> info;
  std::unique_ptr<v1::SessionService::Stub> sessions;
};

// What a call has ended with, and all messages that it has sent.
struct Answer {
  grpc::Status status;
  std::string messages;
};

// A call that looks at one resource and changes nothing.
struct NamedCall {
  std::string rpc;
  AccessWorld::Kind kind;
  AccessWorld::Level need;
  bool open_to_links;
  std::function<Answer(const Stubs& stubs, grpc::ClientContext* context, const std::string& name)>
      call;
};
const std::vector<NamedCall>& NamedCalls();

// A mesh as it is sent.
struct SentMesh {
  explicit SentMesh(uint32_t seed);

  BarProblem problem;
  std::string name;
};
Answer SendMesh(const Stubs& stubs, const AccessWorld::Caller& caller, const SentMesh& mesh,
                v1::UploadMeshResponse* response);
Answer SendCase(const Stubs& stubs, const AccessWorld::Caller& caller, const std::string& bytes,
                const std::string& project, v1::UploadCaseResponse* response);

// All pages, of three names each.
Answer ListNames(const Stubs& stubs, const AccessWorld::Caller& caller, AccessWorld::Kind kind,
                 std::vector<std::string>* names);

}  // namespace tissueform::testing
