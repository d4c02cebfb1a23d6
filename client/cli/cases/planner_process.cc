// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/cases/planner_process.h"

#include <chrono>
#include <filesystem>
#include <memory>
#include <string>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"

#include "client/cli/cases/packed_case.h"
#include "client/cli/session/server_process.h"
#include "core/base/process/child_process.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::seconds kGatewayStartDeadline{30};
constexpr char kCases[] = "cases/";

// In a build folder a link is in its place.
absl::StatusOr<std::string> FindWebFolder() {
  const fs::path folder = fs::path(ProgramFolder()).parent_path() / "share/tissueform/web";
  std::error_code ignored;
  if (fs::is_regular_file(folder / "index.html", ignored)) return folder.string();
  return absl::NotFoundError(absl::StrCat("the planner's files are not in ", folder.string(),
                                          "; build them with deploy/build_web.sh"));
}

}  // namespace

absl::StatusOr<OpenedPlanner> OpenPlannerOfPlan(const std::string& server,
                                                const std::string& plan_path, int port) {
  TF_ASSIGN_OR_RETURN(const std::string program, FindProgram("tissueform-gateway"));
  TF_ASSIGN_OR_RETURN(const std::string web, FindWebFolder());
  TF_ASSIGN_OR_RETURN(const PackedCase packed, PackPlan(plan_path, {}, ""));
  TF_ASSIGN_OR_RETURN(const auto client, TissueformClient::Connect(server, {}));
  TF_ASSIGN_OR_RETURN(const v1::Case published, PublishCase(client.get(), packed.contents,
                                                            packed.bytes, packed.contents.title));
  TF_ASSIGN_OR_RETURN(std::unique_ptr<ServerProcess> gateway,
                      ServerProcess::Start(program,
                                           {"--server", server, "--web", web, "--log-level", "warn",
                                            "--listen", absl::StrCat("127.0.0.1:", port)},
                                           kGatewayStartDeadline));
  std::string url =
      absl::StrCat(gateway->address(), "/#case=", published.name().substr(sizeof(kCases) - 1));
  return OpenedPlanner{.url = std::move(url), .running = std::move(gateway)};
}

}  // namespace tissueform
