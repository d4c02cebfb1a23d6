// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/experiments/locking_experiment.h"

#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "client/lab/accuracy/boundary_surface.h"
#include "client/lab/accuracy/layered_block.h"
#include "core/base/csv_table.h"
#include "core/base/status_macros.h"
#include "core/mechanics/deformation/elastic_system.h"
#include "core/mesh/bar_mesh.h"
#include "core/planning/rendering/figure.h"

namespace tissueform {
namespace {

constexpr double kHalfSideMm = 5;
constexpr double kLengthMm = 20;
constexpr double kCurvature = 0.01;  // 1/mm: the upper end goes aside by 2 mm
constexpr double kBarPa = 15000;
constexpr std::array<double, 5> kPoissonRatios = {0.0, 0.3, 0.45, 0.49, 0.499};
constexpr std::array<int, 4> kBendingCells = {2, 4, 8, 16};
constexpr std::array<int, 3> kFinestBlock = {48, 36, 16};
constexpr std::array<std::array<int, 3>, 3> kBlocks = {{{12, 9, 8}, {24, 18, 8}, {24, 18, 16}}};
constexpr int kChartHeight = 520;

struct LockingRow {
  std::string problem;
  std::string mesh;
  double poisson_ratio = 0;
  LockingError error;
};

// A bar bent by moments about y: the strain along z is curvature * x, those across are
// -poisson_ratio times that, all shears vanish, and so do all stresses but the one along z. Exact
// in three dimensions for any Poisson's ratio, so what is left is the error of the tets alone.
Eigen::RowVector3d ExactBending(const Eigen::Vector3d& v, double poisson_ratio) {
  const double anticlastic = poisson_ratio * (v.x() * v.x() - v.y() * v.y());
  return kCurvature * Eigen::RowVector3d(-(v.z() * v.z() + anticlastic) / 2,
                                         -poisson_ratio * v.x() * v.y(), v.x() * v.z());
}

LockingError ErrorOf(const Positions& displacements, const Positions& better) {
  const Eigen::VectorXd distances = (displacements - better).rowwise().norm();
  LockingError error;
  error.mean_mm = distances.mean();
  error.max_mm = distances.maxCoeff();
  error.mean_percent = 100 * error.mean_mm / better.rowwise().norm().maxCoeff();
  return error;
}

// `prescribed` has a row for every constrained vertex.
absl::StatusOr<Positions> SolveLinear(const TetMesh& mesh, const Eigen::VectorXd& stiffness,
                                      const ConstraintSet& constraints, double poisson_ratio,
                                      const Positions& prescribed) {
  ElasticSystemOptions options;
  options.poisson_ratio = poisson_ratio;
  TF_ASSIGN_OR_RETURN(const auto system,
                      ElasticSystem::Create(mesh, stiffness, constraints, options));
  const Eigen::Map<const Eigen::VectorXd> values(prescribed.data(), prescribed.size());
  TF_ASSIGN_OR_RETURN(const Eigen::MatrixXd solved, system->Solve(Eigen::MatrixXd(), values));
  return Positions(Eigen::Map<const Positions>(solved.data(), mesh.num_vertices(), 3));
}

int VertexIndex(const std::array<int, 3>& cells, int i, int j, int k) {
  return i + (cells[0] + 1) * (j + (cells[1] + 1) * k);
}

std::string MeshName(const std::array<int, 3>& cells) {
  return absl::StrCat(cells[0], " x ", cells[1], " x ", cells[2]);
}

absl::StatusOr<std::vector<LockingRow>> BendingRows() {
  std::vector<LockingRow> rows;
  for (const double poisson_ratio : kPoissonRatios) {
    for (const int cells : kBendingCells) {
      TF_ASSIGN_OR_RETURN(const LockingError error, PureBendingError(cells, poisson_ratio));
      rows.push_back({"pure_bending", MeshName({cells, cells, 2 * cells}), poisson_ratio, error});
    }
  }
  return rows;
}

absl::StatusOr<std::vector<LockingRow>> BlockRows() {
  std::vector<LockingRow> rows;
  for (const double poisson_ratio : kPoissonRatios) {
    TF_ASSIGN_OR_RETURN(const Positions finest, BlockDisplacements(kFinestBlock, poisson_ratio));
    for (const std::array<int, 3>& cells : kBlocks) {
      TF_ASSIGN_OR_RETURN(const Positions coarse, BlockDisplacements(cells, poisson_ratio));
      rows.push_back({"layered_block", MeshName(cells), poisson_ratio,
                      ErrorAgainstFiner(coarse, cells, finest, kFinestBlock)});
    }
  }
  return rows;
}

CsvTable Table(const std::vector<LockingRow>& rows) {
  CsvTable table({"problem", "cells", "nu", "mean_mm", "max_mm", "mean_percent"});
  for (const LockingRow& row : rows) {
    table.AddRow({row.problem, row.mesh, Cell(row.poisson_ratio), Cell(row.error.mean_mm),
                  Cell(row.error.max_mm), Cell(row.error.mean_percent)});
  }
  return table;
}

Colour ColourOf(size_t index) {
  static const std::array<Colour, 5> kColours = {kGrey, kGreen, kBlue, kOrange,
                                                 Colour(0.55, 0.05, 0.15)};
  return kColours[index % kColours.size()];
}

// Error over the number of cells across, a curve for each Poisson's ratio.
Chart BendingChart(const std::vector<LockingRow>& rows) {
  Chart chart;
  chart.title = "bar in pure bending, against the exact solution";
  chart.x_title = "cells across";
  chart.y_title = "mean error, % of the largest displacement";
  chart.logarithmic_y = true;
  for (size_t first = 0; first < rows.size(); first += kBendingCells.size()) {
    Curve curve;
    curve.name = absl::StrFormat("nu = %g", rows[first].poisson_ratio);
    curve.colour = ColourOf(chart.curves.size());
    for (size_t level = 0; level < kBendingCells.size(); ++level) {
      curve.x.push_back(kBendingCells[level]);
      curve.y.push_back(rows[first + level].error.mean_percent);
    }
    chart.curves.push_back(std::move(curve));
  }
  return chart;
}

// Error over Poisson's ratio, a curve for each mesh.
Chart BlockChart(const std::vector<LockingRow>& rows) {
  Chart chart;
  chart.title = "layered block, 5 mm up, against " + MeshName(kFinestBlock) + " cells";
  chart.x_title = "Poisson's ratio";
  chart.y_title = "mean distance, mm";
  chart.y_high = 0.01;  // from zero on
  for (size_t mesh = 0; mesh < kBlocks.size(); ++mesh) {
    Curve curve;
    curve.name = MeshName(kBlocks[mesh]) + " cells";
    curve.colour = ColourOf(mesh + 1);
    for (size_t row = mesh; row < rows.size(); row += kBlocks.size()) {
      curve.x.push_back(rows[row].poisson_ratio);
      curve.y.push_back(rows[row].error.mean_mm);
    }
    chart.curves.push_back(std::move(curve));
  }
  return chart;
}

}  // namespace

absl::StatusOr<LockingError> PureBendingError(int cells, double poisson_ratio) {
  TF_ASSIGN_OR_RETURN(const TetMesh bar, BarMesh({EvenPlanes(-kHalfSideMm, kHalfSideMm, cells),
                                                  EvenPlanes(-kHalfSideMm, kHalfSideMm, cells),
                                                  EvenPlanes(0, kLengthMm, 2 * cells)}));
  TF_ASSIGN_OR_RETURN(const ConstraintSet ends, ConstrainEnds(bar.positions()));
  Positions exact(bar.num_vertices(), 3);
  for (Eigen::Index v = 0; v < exact.rows(); ++v) {
    exact.row(v) = ExactBending(bar.positions().row(v).transpose(), poisson_ratio);
  }
  TF_ASSIGN_OR_RETURN(const Positions found,
                      SolveLinear(bar, Eigen::VectorXd::Constant(bar.num_tets(), kBarPa), ends,
                                  poisson_ratio, exact(ends.constrained(), Eigen::all)));
  return ErrorOf(found, exact);
}

absl::StatusOr<Positions> BlockDisplacements(const std::array<int, 3>& cells,
                                             double poisson_ratio) {
  TF_ASSIGN_OR_RETURN(const LayeredBlock block, MakeLayeredBlock(cells));
  const std::vector<int32_t>& constrained = block.constraints.constrained();
  Positions prescribed = Positions::Zero(static_cast<Eigen::Index>(constrained.size()), 3);
  for (size_t c = 0; c < constrained.size(); ++c) {
    if (block.constraints.region_of_constrained()[c] == ConstraintSet::kFixed) continue;
    prescribed.row(static_cast<Eigen::Index>(c)) = MoveUp().translation_mm.transpose();
  }
  return SolveLinear(block.mesh, block.stiffness, block.constraints, poisson_ratio, prescribed);
}

LockingError ErrorAgainstFiner(const Positions& coarse_displacements,
                               const std::array<int, 3>& coarse,
                               const Positions& fine_displacements,
                               const std::array<int, 3>& fine) {
  // The cells of kFinestBlock are multiples of those of kBlocks: every coarse vertex is a fine one,
  // and nothing is interpolated, which would be an error of its own.
  std::vector<int> same;
  for (int k = 0; k <= coarse[2]; ++k) {
    for (int j = 0; j <= coarse[1]; ++j) {
      for (int i = 0; i <= coarse[0]; ++i) {
        same.push_back(VertexIndex(fine, i * fine[0] / coarse[0], j * fine[1] / coarse[1],
                                   k * fine[2] / coarse[2]));
      }
    }
  }
  return ErrorOf(coarse_displacements, fine_displacements(same, Eigen::all));
}

absl::Status RunLockingExperiment(const ExperimentOptions& options) {
  options.Report("locking: bar in pure bending ...");
  TF_ASSIGN_OR_RETURN(const std::vector<LockingRow> bending, BendingRows());
  options.Report("locking: layered block against a finer one ...");
  TF_ASSIGN_OR_RETURN(const std::vector<LockingRow> block, BlockRows());
  std::vector<LockingRow> all = bending;
  all.insert(all.end(), block.begin(), block.end());
  TF_RETURN_IF_ERROR(Table(all).WriteCsv(options.Path("accuracy_locking.csv")));
  Figure figure("Volumetric locking of tets of constant strain, model linear_elastic");
  figure.AddRow(kChartHeight, {BendingChart(bending), BlockChart(block)});
  return figure.WritePng(options.Path("accuracy_locking.png"));
}

}  // namespace tissueform
