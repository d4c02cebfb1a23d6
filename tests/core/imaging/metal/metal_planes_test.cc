// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// A head with real metal, whole, at three spacings.

#include <cstdlib>
#include <filesystem>
#include <string>
#include <unistd.h>
#include <vector>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/imaging/anatomy/bone_parts.h"
#include "core/imaging/anatomy/landmarks.h"
#include "core/imaging/anatomy/osteotomy.h"
#include "core/imaging/ct/ct_volume_reader.h"
#include "core/imaging/ct/isotropic_resample.h"
#include "core/imaging/metal/metal_reduction.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using testing::SharedDataPath;

struct CutJaw {
  LabelGrid parts;
  std::vector<Plane> planes;
};

// As ResampleWithoutStreaks and what follows it do, with streaks that have been reduced before:
// that does not depend on the spacing, and takes most of the time.
absl::StatusOr<CutJaw> CutAt(const CtVolume& volume, const MetalFindings& findings,
                             double spacing_mm) {
  TF_ASSIGN_OR_RETURN(const HuGrid hu, ResampleIsotropic(volume, spacing_mm, {.threads = 2}));
  TF_ASSIGN_OR_RETURN(const LabelGrid metal, ResampleMask(findings.mask, volume, spacing_mm, 2));
  TF_ASSIGN_OR_RETURN(const HeadSegmentation head, SegmentHead(hu, {}, nullptr, metal));
  TF_ASSIGN_OR_RETURN(BoneParts parts, SeparateBoneParts(head));
  TF_ASSIGN_OR_RETURN(const Landmarks landmarks, FindLandmarks(head, parts));
  return CutJaw{std::move(parts.labels),
                DefaultSegment(OsteotomyKind::kBssro, "jaw", landmarks).planes};
}

// Mean distance of b's plane from the places where a's plane cuts the jaw: voxels within half a
// voxel of it, on the moving side of the others.
double ApartMm(const CutJaw& a, const CutJaw& b, size_t plane) {
  double sum = 0;
  int count = 0;
  ForEachVoxel(a.parts, [&](size_t index, const Eigen::Vector3d& place) {
    if (a.parts.values[index] != kMandible) return;
    for (size_t p = 0; p < a.planes.size(); ++p) {
      const double height = a.planes[p].HeightMm(place);
      const double reach = a.parts.geometry.spacing_mm / 2;
      if (p == plane ? std::abs(height) > reach : height < -reach) return;
    }
    sum += std::abs(b.planes[plane].HeightMm(place));
    ++count;
  });
  return count == 0 ? 1e9 : sum / count;
}

TEST(MetalPlanesTest, TheCutsOfAJawWithFillingsDoNotDependOnTheSpacing) {
  const std::string archive = SharedDataPath("ct_head_vhm_dicom/vhm_head_dicom.tar.xz");
  if (archive.empty()) GTEST_SKIP() << "the shared data sets are not here";
  const std::filesystem::path folder =
      std::filesystem::path(::testing::TempDir()) / absl::StrCat("metal_planes_", getpid());
  std::filesystem::create_directories(folder);
  const std::string unpack =
      absl::StrCat("tar -xJf '", archive, "' -C '", folder.string(), "' --wildcards '*.dcm'");
  ASSERT_EQ(std::system(unpack.c_str()), 0);
  absl::StatusOr<CtVolume> volume = ReadCtVolume((folder / "vhm_head").string());
  std::filesystem::remove_all(folder);
  ASSERT_TRUE(volume.ok()) << volume.status();
  const MetalFindings findings = FindMetal(*volume, {});
  ASSERT_TRUE(ReduceMetalArtifacts(findings, 2, &*volume).any());
  std::vector<CutJaw> jaws;
  for (const double spacing_mm : {1.0, 1.5, 2.0}) {
    ASSERT_OK_AND_ASSIGN(CutJaw jaw, CutAt(*volume, findings, spacing_mm));
    jaws.push_back(std::move(jaw));
  }
  for (size_t a = 0; a < jaws.size(); ++a) {
    for (size_t b = 0; b < jaws.size(); ++b) {
      for (size_t plane = 0; plane < 3; ++plane) {
        EXPECT_LT(ApartMm(jaws[a], jaws[b], plane), 2) << a << " " << b << " plane " << plane;
      }
    }
  }
}

}  // namespace
}  // namespace tissueform
