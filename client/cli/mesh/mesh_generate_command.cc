// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/mesh/mesh_generate_command.h"

#include <cmath>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"

#include "client/cli/mesh/generation_report.h"
#include "client/cli/shared/option_checks.h"
#include "client/cli/shared/report_parts.h"
#include "client/cli/shared/stage_progress.h"
#include "core/base/status_macros.h"
#include "core/mesh/generation/tetrahedralization.h"
#include "core/mesh/io/triangle_mesh_io.h"

namespace tissueform {
namespace {

struct MeshGenerateOptions {
  std::string surface;
  std::string out;
  std::string defects;
  double wrap_mm = 0;
  double remesh_mm = 0;
  double edge_mm = 0;
  bool split_surface = false;
  std::vector<std::string> regions;
  std::vector<std::string> holes;
  TetrahedralizationOptions filling;
  double max_memory_gib = 4;
  bool json = false;
};

// "1,2,3" as numbers; empty when a part is not a number.
std::vector<double> Numbers(const std::string& text) {
  std::vector<double> numbers;
  for (const absl::string_view part : absl::StrSplit(text, ',')) {
    if (!absl::SimpleAtod(part, &numbers.emplace_back())) return {};
  }
  return numbers;
}

// CLI11's own check prints the largest number there is, with 309 digits.
CLI::Validator Positive() {
  const auto check = [](const std::string& text) -> std::string {
    double value = 0;
    if (absl::SimpleAtod(text, &value) && std::isfinite(value) && value > 0) return "";
    return absl::StrCat("\"", text, "\" is not a number above 0");
  };
  return {check, "POSITIVE"};
}

CLI::Validator NumbersBetweenCommas(size_t least, size_t most, const char* form) {
  const auto check = [=](std::string& text) {
    const size_t count = Numbers(text).size();
    return count >= least && count <= most
               ? std::string()
               : absl::StrCat(text, " does not have the form ", form, " (numbers, no spaces)");
  };
  return {check, form, form};
}

TetrahedralizationOptions Filling(const MeshGenerateOptions& options) {
  TetrahedralizationOptions filling = options.filling;
  filling.keep_surface = !options.split_surface;
  filling.limits.max_memory_bytes =
      static_cast<int64_t>(options.max_memory_gib * static_cast<double>(int64_t{1} << 30));
  if (options.edge_mm > 0) filling.max_tet_volume_mm3 = RegularTetVolume(options.edge_mm);
  for (const std::string& text : options.regions) {
    const std::vector<double> n = Numbers(text);
    filling.regions.push_back(
        {Eigen::Vector3d(n[0], n[1], n[2]), static_cast<int32_t>(n[3]), n.size() > 4 ? n[4] : 0});
  }
  for (const std::string& text : options.holes) {
    const std::vector<double> n = Numbers(text);
    filling.holes_mm.emplace_back(n[0], n[1], n[2]);
  }
  return filling;
}

// Beside the mesh that there is not: face.vtu, face.defects.vtp.
std::string DefectFile(const MeshGenerateOptions& options) {
  if (!options.defects.empty()) return options.defects;
  return std::filesystem::path(options.out).replace_extension(".defects.vtp").string();
}

absl::Status WriteDefects(const MeshGenerateOptions& options, const TriangleMesh& surface,
                          GenerationReport* report) {
  report->defect_file = DefectFile(options);
  return WriteTriangleMesh(
      report->defect_file,
      {.mesh = surface, .point_data = {}, .cell_data = {FlawArray(report->defects)}});
}

// The surface of the file, or its wrap.
absl::StatusOr<TriangleMesh> OuterSurface(const MeshGenerateOptions& options,
                                          const TriangleMesh& surface, GenerationReport* report) {
  if (options.wrap_mm == 0) return surface;
  const StageProgress progress("wrapping the surface");
  WrappingOptions wrapping;
  wrapping.offset_mm = report->wrap_mm = options.wrap_mm;
  wrapping.limits = Filling(options).limits;
  TF_ASSIGN_OR_RETURN(report->wrapped, WrapSurface(surface, wrapping));
  return report->wrapped->mesh;
}

// The surface that is filled: the one of the file, its wrap, or either of them remeshed.
absl::StatusOr<TriangleMesh> SurfaceToFill(const MeshGenerateOptions& options,
                                           const TriangleMesh& file_surface,
                                           GenerationReport* report) {
  TF_ASSIGN_OR_RETURN(const TriangleMesh surface, OuterSurface(options, file_surface, report));
  if (options.remesh_mm == 0) {
    if (!report->wrapped) TF_RETURN_IF_ERROR(CheckMeshable(report->defects));
    return surface;
  }
  const StageProgress progress("remeshing the surface");
  RemeshingOptions remeshing;
  remeshing.edge_mm = report->remesh_mm = options.remesh_mm;
  TF_ASSIGN_OR_RETURN(report->remeshed, RemeshSurface(surface, remeshing));
  return report->remeshed->mesh;
}

absl::StatusOr<TetMeshFile> Fill(const MeshGenerateOptions& options, const TriangleMesh& surface) {
  const StageProgress progress("filling the surface with tets");
  TF_ASSIGN_OR_RETURN(Tetrahedralization filled, Tetrahedralize(surface, Filling(options)));
  TetMeshFile file{.mesh = std::move(filled.mesh), .point_data = {}, .cell_data = {}};
  if (!filled.region_of_tet.empty()) {
    file.cell_data.push_back({"region", 1, std::move(filled.region_of_tet)});
  }
  return file;
}

absl::StatusOr<TetMeshFile> Make(const MeshGenerateOptions& options, const TriangleMesh& surface,
                                 GenerationReport* report) {
  TF_ASSIGN_OR_RETURN(const TriangleMesh to_fill, SurfaceToFill(options, surface, report));
  return Fill(options, to_fill);
}

// An offset that is larger than this part of the surface's diagonal changes its shape: it is not
// recommended.
constexpr double kLargestUsefulOffset = 0.02;

// The option that would fill this surface; empty where none would.
std::string WrapAdvice(const MeshGenerateOptions& options, const TriangleMesh& surface,
                       const SurfaceDefects& defects) {
  const bool has_shape =
      defects.Find("non_finite_vertices") == nullptr && defects.report.area_mm2 > 0;
  if (options.wrap_mm > 0 || defects.can_be_meshed() || !has_shape) return "";
  const Eigen::RowVector3d size =
      surface.positions().colwise().maxCoeff() - surface.positions().colwise().minCoeff();
  const double offset_mm = OffsetThatBridges(surface);
  if (offset_mm > kLargestUsefulOffset * size.norm()) return "";
  if (offset_mm == 0) return "; to fill it, wrap it (`--wrap-mm`)";
  return absl::StrFormat("; to fill it, wrap it (`--wrap-mm` %.2g or more bridges its openings)",
                         offset_mm * 1.05);
}

absl::Status Refuse(const MeshGenerateOptions& options, const TriangleMesh& surface,
                    const absl::Status& why, GenerationReport* report) {
  std::string look = WrapAdvice(options, surface, report->defects);
  if (!report->defects.can_be_meshed()) {
    TF_RETURN_IF_ERROR(WriteDefects(options, surface, report));
    absl::StrAppend(&look, "; see ", report->defect_file);
  }
  PrintReport(options.json, GenerationReportText(*report), GenerationReportJson(*report));
  return {why.code(), absl::StrCat("surface ", options.surface, ": ", why.message(), look)};
}

SurfaceDefects LookForDefects(const TriangleMesh& surface) {
  const StageProgress progress("finding surface defects");
  return FindSurfaceDefects(surface);
}

absl::Status RunMeshGenerate(const MeshGenerateOptions& options) {
  TF_ASSIGN_OR_RETURN(const TriangleMeshFile file, ReadTriangleMesh(options.surface));
  GenerationReport report{.surface = options.surface,
                          .space = file.space,
                          .defects = LookForDefects(file.mesh),
                          .defect_file = "",
                          .wrap_mm = 0,
                          .wrapped = {},
                          .remesh_mm = 0,
                          .remeshed = {},
                          .mesh = options.out,
                          .made = {}};
  absl::StatusOr<TetMeshFile> made = Make(options, file.mesh, &report);
  if (!made.ok()) return Refuse(options, file.mesh, made.status(), &report);
  TF_RETURN_IF_ERROR(WriteTetMesh(options.out, *made));
  if (!options.defects.empty()) TF_RETURN_IF_ERROR(WriteDefects(options, file.mesh, &report));
  report.made = std::move(*made);
  PrintReport(options.json, GenerationReportText(report), GenerationReportJson(report));
  return absl::OkStatus();
}

void AddQualityOptions(CLI::App* generate, MeshGenerateOptions* options) {
  TetrahedralizationOptions& filling = options->filling;
  generate
      ->add_option("--wrap-mm", options->wrap_mm,
                   absl::StrCat("wrap the surface first, at this distance: fills open, "
                                "intersecting and separate pieces; gaps up to ",
                                2 * kAlphaPerOffset, " times as wide are bridged (alpha is ",
                                kAlphaPerOffset, " times the distance)"))
      ->check(Positive());
  generate
      ->add_option("--remesh-mm", options->remesh_mm,
                   "remesh the surface to edges of this length first")
      ->check(Positive());
  auto* edge = generate
                   ->add_option("--edge-mm", options->edge_mm,
                                "largest tets inside: the volume of a regular tet with this edge")
                   ->check(Positive());
  generate
      ->add_option("--max-volume-mm3", filling.max_tet_volume_mm3, "largest volume of a tet inside")
      ->check(Positive())
      ->excludes(edge);
  generate
      ->add_option("--radius-edge", filling.max_radius_edge_ratio,
                   "target ratio of circumradius to shortest edge")
      ->capture_default_str()
      ->check(CLI::Range(1.1, 100.0));
  generate
      ->add_option("--min-dihedral-deg", filling.min_dihedral_deg, "target minimum dihedral angle")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 18.0));
  generate->add_flag("--split-surface", options->split_surface,
                     "allow surface triangles to be split, for better and smaller tets there");
}

void AddPartOptions(CLI::App* generate, MeshGenerateOptions* options) {
  generate
      ->add_option("--region", options->regions,
                   "the part around this point gets this number in the array `region`, and its own "
                   "largest volume (repeatable)")
      ->check(NumbersBetweenCommas(4, 5, "X,Y,Z,NUMBER[,VOLUME]"))
      ->allow_extra_args(false);
  generate
      ->add_option("--hole", options->holes,
                   "the part around this point stays empty, as a cavity (repeatable)")
      ->check(NumbersBetweenCommas(3, 3, "X,Y,Z"))
      ->allow_extra_args(false);
  generate
      ->add_option("--max-seconds", options->filling.limits.max_seconds, "time limit for filling")
      ->capture_default_str()
      ->check(CLI::Range(1, 86400));
  generate->add_option("--max-memory-gib", options->max_memory_gib, "memory limit for filling")
      ->capture_default_str()
      ->check(CLI::Range(0.01, 1024.0));
}

constexpr char kFooter[] =
    "The surface must be closed and must not intersect itself, or be wrapped with --wrap-mm.\n"
    "Otherwise the report says why, and the array `defect` of the .vtp file marks each triangle: 1 "
    "turned, 2 open edge,\n"
    "3 edge of three or more triangles, 4 intersects another, 5 duplicate, 6 no area. Walls of\n"
    "cavities face inward. The surface's vertices come first in the mesh.\n"
    "Examples:\n"
    "  tissueform mesh generate tongue.obj --out tongue.vtu\n"
    "  tissueform mesh generate face.stl --out face.vtu --remesh-mm 3 --edge-mm 5\n"
    "  tissueform mesh generate jaw.ply --out jaw.vtu --region 0,12,4,1 --region 0,30,4,2,0.5\n"
    "  tissueform mesh generate skull.stl --out skull.vtu --wrap-mm 0.5\n"
    "  tissueform mesh generate skull.obj --out skull.vtu --defects why.vtp --json\n"
    "Exit code 0: filled. 1: the surface cannot be filled or read. 2: wrong use.";

}  // namespace

void AddMeshGenerateCommand(CLI::App& mesh, CommandWork* work) {
  auto options = std::make_shared<MeshGenerateOptions>();
  CLI::App* generate = mesh.add_subcommand("generate", "fill a closed surface with tets");
  generate->add_option("SURFACE", options->surface, "triangles (.vtp .stl .ply .obj .off)")
      ->required();
  generate->add_option("--out", options->out, "mesh file to write")->required()->check(VtuEnding());
  AddQualityOptions(generate, options.get());
  AddPartOptions(generate, options.get());
  generate
      ->add_option(
          "--defects", options->defects,
          "file in which defective triangles are marked (default: MESH.defects.vtp, if the "
          "surface is rejected)")
      ->check(VtpEnding());
  generate->add_flag("--json", options->json, "print the report as JSON");
  generate->footer(kFooter);
  generate->callback([options, work] { *work = [options] { return RunMeshGenerate(*options); }; });
}

}  // namespace tissueform
