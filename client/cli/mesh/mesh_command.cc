// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/mesh/mesh_command.h"

#include <memory>
#include <string>

#include "absl/strings/str_cat.h"

#include "client/cli/mesh/mesh_generate_command.h"
#include "client/cli/mesh/mesh_report.h"
#include "client/cli/mesh/surface_report.h"
#include "client/cli/shared/report_parts.h"
#include "client/cli/shared/stage_progress.h"
#include "core/base/status_macros.h"
#include "core/mesh/io/tet_mesh_io.h"
#include "core/mesh/io/triangle_mesh_io.h"
#include "core/mesh/surface_validation.h"
#include "core/mesh/validation.h"

namespace tissueform {
namespace {

struct MeshCheckOptions {
  std::string mesh;
  bool json = false;
};

absl::Status NameMesh(const std::string& path, const absl::Status& usable) {
  if (usable.ok()) return usable;
  return absl::Status(usable.code(), absl::StrCat("mesh ", path, ": ", usable.message()));
}

absl::Status CheckTets(const MeshCheckOptions& options) {
  TF_ASSIGN_OR_RETURN(const TetMeshFile file, ReadTetMesh(options.mesh));
  const MeshReport report = ReportOfTets(file);
  PrintReport(options.json, MeshReportText(options.mesh, file, report),
              MeshReportJson(options.mesh, file, report));
  return NameMesh(options.mesh, CheckUsable(report));
}

absl::Status CheckSurface(const MeshCheckOptions& options) {
  TF_ASSIGN_OR_RETURN(const TriangleMeshFile file, ReadTriangleMesh(options.mesh));
  SurfaceReport report = ValidateTriangleMesh(file.mesh, file.split_polygons);
  AddImplausibleSize(file.mesh.positions(), &report.defects);
  PrintReport(options.json, SurfaceReportText(options.mesh, file, report),
              SurfaceReportJson(options.mesh, file, report));
  return NameMesh(options.mesh, CheckDefects(report.defects));
}

absl::Status RunMeshCheck(const MeshCheckOptions& options) {
  const StageProgress progress("checking the mesh");
  return NamesSurface(options.mesh) ? CheckSurface(options) : CheckTets(options);
}

}  // namespace

CLI::App* AddMeshCommand(CLI::App& app, CommandWork* work) {
  CLI::App* mesh = app.add_subcommand("mesh", "work on meshes");
  mesh->footer(
      "Examples:\n"
      "  tissueform mesh check face.vtu\n"
      "  tissueform mesh generate face.stl --out face.vtu\n"
      "  tissueform mesh list --server localhost:50051");

  auto options = std::make_shared<MeshCheckOptions>();
  CLI::App* check = mesh->add_subcommand("check", "validate a mesh of tets or a surface");
  check
      ->add_option("MESH", options->mesh,
                   "tets (.vtu .vtk .msh .mesh .node .ele) or triangles (.vtp .stl .ply .obj "
                   ".off)")
      ->required();
  check->add_flag("--json", options->json, "print the report as JSON");
  check->footer(
      "Examples:\n"
      "  tissueform mesh check face.vtu\n"
      "  tissueform mesh check face.vtu --json\n"
      "  tissueform mesh check skull.stl\n"
      "Exit code 0: usable, perhaps with warnings. 1: not usable or not readable.");
  check->callback([options, work] { *work = [options] { return RunMeshCheck(*options); }; });
  AddMeshGenerateCommand(*mesh, work);
  return mesh;
}

}  // namespace tissueform
