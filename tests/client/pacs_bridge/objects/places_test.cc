// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// A marker at a known place of the patient, from the slices of a CT to the triangles of a model.

#include <cmath>
#include <cstring>

#include <Eigen/Geometry>

#include "core/imaging/anatomy/surface_extraction.h"
#include "core/imaging/ct/ct_volume_reader.h"
#include "core/imaging/ct/isotropic_resample.h"
#include "tests/client/pacs_bridge/objects/objects_fixture.h"

namespace tissueform::testing {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kAllowedMm = 0.01;
// The marker is a ball that fades, so that nothing depends on which voxels its edge meets.
constexpr double kMarkerSigmaMm = 8;
constexpr double kMarkerHu = 3000;
constexpr float kMarkerLevelHu = 200;

struct SeriesCase {
  const char* word;
  Matrix3d axes;  // along a row, along a column, from slice to slice
};

Matrix3d Oblique() {
  return Eigen::AngleAxisd(0.5, Vector3d(1, -2, 0.7).normalized()).toRotationMatrix();
}

// As Philips writes it: slices turned about their rows, stacked along z.
Matrix3d Tilted(double degrees) {
  const double angle = degrees * M_PI / 180;
  Matrix3d axes = Matrix3d::Identity();
  axes.col(1) = Vector3d(0, std::cos(angle), -std::sin(angle));
  return axes;
}

class PlacesTest : public ObjectsFixture, public ::testing::WithParamInterface<SeriesCase> {
 protected:
  static Vector3d Numbers(DcmItem* item, const DcmTagKey& tag, unsigned long from) {
    Vector3d numbers;
    for (unsigned long i = 0; i < 3; ++i) {
      EXPECT_TRUE(item->findAndGetFloat64(tag, numbers[static_cast<int>(i)], from + i).good());
    }
    return numbers;
  }

  // Puts the marker into the pixels of a slice, by what its own header says of their places
  // (PS3.3 C.7.6.2.1.1).
  static void PaintMarker(const std::string& path, const Vector3d& marker_mm) {
    const auto file = Load(path);
    DcmDataset* slice = file->getDataset();
    const Vector3d origin = Numbers(slice, DCM_ImagePositionPatient, 0);
    const Vector3d along_row = Numbers(slice, DCM_ImageOrientationPatient, 0);
    const Vector3d along_column = Numbers(slice, DCM_ImageOrientationPatient, 3);
    Float64 between_rows = 0;
    Float64 between_columns = 0;
    slice->findAndGetFloat64(DCM_PixelSpacing, between_rows, 0);
    slice->findAndGetFloat64(DCM_PixelSpacing, between_columns, 1);
    Uint16 rows = 0;
    Uint16 columns = 0;
    slice->findAndGetUint16(DCM_Rows, rows);
    slice->findAndGetUint16(DCM_Columns, columns);
    std::vector<Uint16> pixels;
    for (int row = 0; row < rows; ++row) {
      for (int column = 0; column < columns; ++column) {
        const Vector3d place =
            origin + along_row * (between_columns * column) + along_column * (between_rows * row);
        const double distance = (place - marker_mm).norm() / kMarkerSigmaMm;
        const double hu = kMarkerHu * std::exp(-distance * distance / 2) - 1000;
        pixels.push_back(static_cast<Uint16>(std::lround(hu + 1024)));
      }
    }
    slice->putAndInsertUint16Array(DCM_PixelData, pixels.data(), pixels.size());
    EXPECT_TRUE(file->saveFile(path.c_str(), EXS_LittleEndianExplicit).good());
  }

  // What `plan build` does with a series until there is a surface.
  absl::StatusOr<TriangleMesh> SurfaceOfSeries() const {
    const auto volume = ReadCtVolume((folder_ / "ct").string());
    if (!volume.ok()) return volume.status();
    const auto hu = ResampleIsotropic(*volume, 1);
    if (!hu.ok()) return hu.status();
    VoxelGrid<float> grid(hu->geometry);
    std::copy(hu->values.begin(), hu->values.end(), grid.values.begin());
    return ExtractSurface(grid, {.level = kMarkerLevelHu, .clearance = 0.01F});
  }

  // The middle of what the triangles of a binary STL enclose.
  static Vector3d MiddleOf(DcmDataset* dataset) {
    const Uint8* bytes = nullptr;
    unsigned long count = 0;
    EXPECT_TRUE(dataset->findAndGetUint8Array(DCM_EncapsulatedDocument, bytes, &count).good());
    Vector3d sum = Vector3d::Zero();
    double volume = 0;
    for (unsigned long at = 84; at + 50 <= count; at += 50) {
      Eigen::Matrix3f corners;
      std::memcpy(corners.data(), bytes + at + 12, sizeof(corners));
      const Matrix3d tet = corners.cast<double>();
      sum += tet.determinant() * tet.rowwise().sum() / 4;
      volume += tet.determinant();
    }
    return sum / volume;
  }
};

TEST_P(PlacesTest, MarkerOfTheCtKeepsItsPlaceInTheModel) {
  CtSeriesOptions options;
  options.rows = 64;
  options.columns = 64;
  options.slices = 48;
  options.pixel_spacing_mm = 1;
  options.slice_spacing_mm = 1.5;
  options.axes = GetParam().axes;
  options.origin_mm = {-131.25, -67.5, -912.625};
  PredictionObjectsInput input = MakeInput(options);
  const Vector3d marker = options.origin_mm + options.axes * Vector3d(31.3, 32.1, 35.8);
  for (const std::string& path : series_.files) PaintMarker(path, marker);
  ASSERT_OK_AND_ASSIGN(const TriangleMesh surface, SurfaceOfSeries());
  // The skin of the case is the marker and follows nothing.
  input.contents.surfaces[0].positions = surface.positions().cast<float>();
  input.contents.surfaces[0].triangles = surface.triangles();
  input.contents.surfaces[0].follows.reset();
  input.contents.surfaces[0].regions.clear();
  const auto objects = Write(input);
  const auto model = Load(objects.at("stl:skin-before").path);
  const Vector3d found = MiddleOf(model->getDataset());
  RecordProperty("miss_mm", absl::StrCat((found - marker).norm()));
  EXPECT_LT((found - marker).norm(), kAllowedMm)
      << found.transpose() << " instead of " << marker.transpose();
  EXPECT_EQ(Value(model->getDataset(), DCM_FrameOfReferenceUID), series_.frame_uid);
}

INSTANTIATE_TEST_SUITE_P(Series, PlacesTest,
                         ::testing::Values(SeriesCase{"Orthogonal", Matrix3d::Identity()},
                                           SeriesCase{"Oblique", Oblique()},
                                           SeriesCase{"Tilted", Tilted(18.5)},
                                           SeriesCase{"TiltedAndOblique", Oblique() * Tilted(-12)}),
                         [](const auto& series) { return std::string(series.param.word); });

}  // namespace
}  // namespace tissueform::testing
