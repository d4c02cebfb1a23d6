// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/tet_stiffness.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/imaging/anatomy/tet_voxels.h"

namespace tissueform {
namespace {

// Of the cube about a barycentre, in voxels. Where it holds no pure voxel a tet lies deep in bone,
// and muscle some mm away says nothing of it.
constexpr int kMaxRadius = 3;

struct Mean {
  double sum = 0;
  double weight = 0;

  void Add(double value, double its_weight = 1) {
    sum += its_weight * value;
    weight += its_weight;
  }
  bool empty() const { return weight <= 0; }
  double value() const { return sum / weight; }
};

class CtNumbers {
 public:
  CtNumbers(const HuGrid& hu, const LabelGrid& bone, double air_below_hu)
      : hu_(hu), bone_(bone), air_below_hu_(air_below_hu) {}

  double air_below_hu() const { return air_below_hu_; }
  double At(int x, int y, int z) const { return hu_.At(x, y, z); }

  // The partial-volume effect: a voxel at a border holds some of both sides, and fat beside air or
  // muscle beside bone would come out as a tissue that is not there. One voxel is as far as the
  // scanner's blur reaches after resampling.
  bool IsMixed(int x, int y, int z) const {
    return AnyWithin(1, {x, y, z}, [this](int a, int b, int c) {
      return bone_.At(a, b, c) != 0 || hu_.At(a, b, c) < air_below_hu_;
    });
  }

  // At a place in units of voxels, of its eight neighbours, mixed ones included or not.
  Mean Interpolate(const Eigen::Vector3d& place, bool with_mixed) const {
    const VoxelCell cell(place, hu_.geometry.size);
    Mean mean;
    for (unsigned corner = 0; corner < 8; ++corner) {
      const double weight = cell.Weight(corner);
      if (weight <= 0) continue;
      const auto [x, y, z] = cell.Corner(corner);
      if (with_mixed || !IsMixed(x, y, z)) mean.Add(At(x, y, z), weight);
    }
    return mean;
  }

  // Of the voxels that are not mixed, in the smallest cube about a place that has any.
  Mean Surroundings(const Eigen::Vector3d& place) const {
    const Eigen::Vector3i centre = place.array().round().cast<int>();
    Mean mean;
    for (int radius = 1; radius <= kMaxRadius && mean.empty(); ++radius) {
      AnyWithin(radius, centre, [this, &mean](int x, int y, int z) {
        if (!IsMixed(x, y, z)) mean.Add(At(x, y, z));
        return false;
      });
    }
    return mean;
  }

 private:
  // Whether the predicate holds for any voxel of the grid in the cube about a voxel.
  template <typename Predicate>
  bool AnyWithin(int radius, const Eigen::Vector3i& centre, const Predicate& predicate) const {
    const auto& size = hu_.geometry.size;
    const auto first = [&](int axis) { return std::max(0, centre[axis] - radius); };
    const auto last = [&](int axis) {
      return std::min(size[static_cast<size_t>(axis)] - 1, centre[axis] + radius);
    };
    for (int z = first(2); z <= last(2); ++z) {
      for (int y = first(1); y <= last(1); ++y) {
        for (int x = first(0); x <= last(0); ++x) {
          if (predicate(x, y, z)) return true;
        }
      }
    }
    return false;
  }

  const HuGrid& hu_;
  const LabelGrid& bone_;
  double air_below_hu_;
};

Eigen::Vector3d Barycentre(const TetMesh& mesh, Eigen::Index tet) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const int32_t vertex : mesh.tets().row(tet)) sum += mesh.positions().row(vertex);
  return sum / 4;
}

// Also false where it is not finite.
bool LiesInGrid(const Eigen::Vector3d& place, const GridGeometry& grid) {
  for (int axis = 0; axis < 3; ++axis) {
    const double end = grid.size[static_cast<size_t>(axis)] - 0.5;
    if (!(place[axis] >= -0.5 && place[axis] <= end)) return false;
  }
  return true;
}

absl::Status CheckGrids(const HuGrid& hu, const LabelGrid& bone) {
  const GridGeometry& a = hu.geometry;
  const GridGeometry& b = bone.geometry;
  if (a.size == b.size && a.origin_mm == b.origin_mm && a.spacing_mm == b.spacing_mm) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError("the mask of bone and the CT are not on the same grid");
}

absl::Status CheckMesh(const TetMesh& mesh, const GridGeometry& grid) {
  if (!mesh.positions().allFinite()) {
    return absl::InvalidArgumentError("a vertex of the mesh has no finite position");
  }
  for (Eigen::Index tet = 0; tet < mesh.num_tets(); ++tet) {
    if (!LiesInGrid(grid.ToVoxels(Barycentre(mesh, tet)), grid)) {
      return absl::InvalidArgumentError(
          absl::StrCat("tet ", tet, " is outside the CT: its stiffness is unknown"));
    }
  }
  return absl::OkStatus();
}

struct TetMeans {
  Mean unmixed;
  Mean mixed;
};

std::vector<TetMeans> MeansOfTets(const TetMesh& mesh, const GridGeometry& grid,
                                  const CtNumbers& numbers) {
  std::vector<TetMeans> means(static_cast<size_t>(mesh.num_tets()));
  ForEachVoxelInTets(mesh, grid, [&](Eigen::Index tet, int x, int y, int z) {
    TetMeans& of_tet = means[static_cast<size_t>(tet)];
    (numbers.IsMixed(x, y, z) ? of_tet.mixed : of_tet.unmixed).Add(numbers.At(x, y, z));
  });
  return means;
}

// The rule of the header; counts which way was taken.
Mean Choose(const TetMeans& means, const Eigen::Vector3d& barycentre, const CtNumbers& numbers,
            TetStiffness* result) {
  if (!means.unmixed.empty()) {
    ++result->from_voxels;
    return means.unmixed;
  }
  if (const Mean mean = numbers.Interpolate(barycentre, false); !mean.empty()) {
    ++result->from_barycentre;
    return mean;
  }
  if (const Mean mean = numbers.Surroundings(barycentre); !mean.empty()) {
    ++result->from_surroundings;
    return mean;
  }
  ++result->from_mixed_voxels;
  const Mean mixed = means.mixed.empty() ? numbers.Interpolate(barycentre, true) : means.mixed;
  // No model holds air: where the CT has it, thin skin was thickened.
  Mean tissue;
  tissue.Add(std::max(mixed.value(), numbers.air_below_hu()));
  return tissue;
}

// Nothing where the CT decides.
std::optional<int> KnownTissue(const LabelGrid* known, const Eigen::Vector3d& barycentre) {
  if (known == nullptr || known->values.empty()) return std::nullopt;
  const Eigen::Vector3i voxel = barycentre.array().round().cast<int>();
  const uint8_t value = known->At(voxel.x(), voxel.y(), voxel.z());
  if (value == 0) return std::nullopt;
  return value - 1;
}

}  // namespace

absl::StatusOr<TetStiffness> ComputeTetStiffness(const TetMesh& mesh, const HuGrid& hu,
                                                 const LabelGrid& bone,
                                                 const TetStiffnessOptions& options) {
  TF_RETURN_IF_ERROR(CheckStiffnessTable(options.table));
  TF_RETURN_IF_ERROR(CheckGrids(hu, bone));
  TF_RETURN_IF_ERROR(CheckMesh(mesh, hu.geometry));
  const CtNumbers numbers(hu, bone, options.air_below_hu);
  const std::vector<TetMeans> means = MeansOfTets(mesh, hu.geometry, numbers);
  TetStiffness result;
  for (Eigen::Index tet = 0; tet < mesh.num_tets(); ++tet) {
    const TetMeans& of_tet = means[static_cast<size_t>(tet)];
    const Eigen::Vector3d barycentre = hu.geometry.ToVoxels(Barycentre(mesh, tet));
    const int64_t mixed_before = result.from_mixed_voxels;
    const double mean_hu = Choose(of_tet, barycentre, numbers, &result).value();
    const bool mixed = result.from_mixed_voxels > mixed_before;
    const std::optional<int> known = KnownTissue(options.known_tissue, barycentre);
    if (known) ++result.from_known_tissue;
    const int tissue = known.value_or(TissueOf(options.table, mean_hu));
    result.mean_hu.push_back(mean_hu);
    result.voxels.push_back(
        static_cast<int32_t>(mixed ? of_tet.mixed.weight : of_tet.unmixed.weight));
    result.tissue.push_back(tissue);
    result.youngs_modulus_pa.push_back(
        options.table[static_cast<size_t>(tissue)].youngs_modulus_pa);
  }
  return result;
}

}  // namespace tissueform
