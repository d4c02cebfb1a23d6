// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/session/server_mesh_command.h"

#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

#include "client/cli/session/server_connection.h"
#include "client/cli/session/upload_lines.h"
#include "client/cli/shared/companion.h"
#include "client/cpp/tissueform_client.h"
#include "core/base/status_macros.h"
#include "core/base/stopwatch.h"
#include "core/mesh/io/tet_mesh_io.h"
#include "core/mesh/mesh_defect.h"
#include "proto/conversion/mesh_conversion.h"

namespace tissueform {
namespace {

struct ServerMeshOptions {
  ServerConnection server;
  std::string mesh;
};

// With the collection's name or without.
std::string FullMeshName(const std::string& name) {
  return name.rfind("meshes/", 0) == 0 ? name : MeshName(name);
}

// What a session can take its stiffness from; more components than one say something else.
std::vector<CellArray> ScalarsOfTets(const TetMeshFile& file) {
  std::vector<CellArray> arrays;
  for (const Attribute& attribute : file.cell_data) {
    if (attribute.components != 1) continue;
    const std::vector<double> values = ToDoubles(attribute);
    arrays.push_back(
        {attribute.name, Eigen::Map<const Eigen::VectorXd>(
                             values.data(), static_cast<Eigen::Index>(values.size()))});
  }
  return arrays;
}

void PrintMesh(const v1::Mesh& mesh) {
  absl::PrintF("%-71s %10d %10d %10d  %s\n", mesh.name(), mesh.vertex_count(), mesh.tet_count(),
               mesh.skin_vertex_count(), absl::StrJoin(mesh.cell_arrays(), ", "));
}

void PrintHead() {
  absl::PrintF("%-71s %10s %10s %10s  %s\n", "mesh", "vertices", "tets", "skin", "arrays of tets");
}

absl::Status Upload(const ServerMeshOptions& options) {
  TF_ASSIGN_OR_RETURN(const TetMeshFile file, ReadTetMesh(options.mesh));
  if (const auto size = FindImplausibleSize(file.mesh.positions())) {
    absl::FPrintF(stderr, "warning: mesh %s: %s\n", options.mesh, size->explanation);
  }
  TF_ASSIGN_OR_RETURN(const auto client, ConnectTo(options.server));
  const Stopwatch stopwatch;
  UploadLines lines([](const std::string& line) { absl::FPrintF(stderr, "%s\n", line); },
                    [&stopwatch] { return stopwatch.Seconds(); });
  TF_ASSIGN_OR_RETURN(const v1::Mesh mesh,
                      client->UploadMesh(file.mesh, ScalarsOfTets(file), lines.Options()));
  PrintHead();
  PrintMesh(mesh);
  return absl::OkStatus();
}

absl::Status List(const ServerMeshOptions& options) {
  TF_ASSIGN_OR_RETURN(const auto client, ConnectTo(options.server));
  TF_ASSIGN_OR_RETURN(const std::vector<v1::Mesh> meshes, client->ListMeshes());
  PrintHead();
  for (const v1::Mesh& mesh : meshes) PrintMesh(mesh);
  absl::PrintF("%d meshes\n", meshes.size());
  return absl::OkStatus();
}

absl::Status Delete(const ServerMeshOptions& options) {
  TF_ASSIGN_OR_RETURN(const auto client, ConnectTo(options.server));
  TF_RETURN_IF_ERROR(client->DeleteMesh(FullMeshName(options.mesh)));
  absl::PrintF("deleted %s\n", FullMeshName(options.mesh));
  return absl::OkStatus();
}

}  // namespace

void AddServerMeshCommand(CLI::App& app, CommandWork* work) {
  auto options = std::make_shared<ServerMeshOptions>();
  CLI::App* command = app.add_subcommand("mesh", "list the meshes of a server");
  command->require_subcommand(1);
  const auto add = [&](const CompanionCommand& companion, const char* what,
                       absl::Status (*run)(const ServerMeshOptions&)) {
    CLI::App* sub = command->add_subcommand(companion.name, companion.description);
    if (what != nullptr) sub->add_option("MESH", options->mesh, what)->required();
    AddServerOption(sub, &options->server);
    sub->callback([options, work, run] { *work = [options, run] { return run(*options); }; });
  };
  add(kMeshUploadCommand,
      "a mesh of tetrahedra (.vtu .vtk .msh .mesh .node .ele), with its scalar cell arrays",
      Upload);
  add(kMeshListCommand, nullptr, List);
  add(kMeshDeleteCommand, "mesh name, with or without \"meshes/\"", Delete);
}

}  // namespace tissueform
