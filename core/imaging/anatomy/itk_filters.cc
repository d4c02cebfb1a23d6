// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/itk_filters.h"

#include <algorithm>
#include <cmath>
#include <itkConnectedComponentImageFilter.h>
#include <itkDiscreteGaussianImageFilter.h>
#include <itkImage.h>
#include <itkMorphologicalWatershedFromMarkersImageFilter.h>
#include <itkMultiThreaderBase.h>
#include <itkObject.h>
#include <itkRelabelComponentImageFilter.h>
#include <limits>

#include "core/imaging/anatomy/distance_transform.h"
#include "core/imaging/anatomy/grid_operations.h"

namespace tissueform {
namespace {

// Settings of ITK for this process; made again they change nothing. Threads that begin and end with
// a filter: ITK's default is a pool, which keeps one a core for good and cuts images into four
// times as many parts.
void SetUpItk() {
  itk::MultiThreaderBase::SetGlobalDefaultThreader(itk::MultiThreaderBase::ThreaderEnum::Platform);
  itk::Object::GlobalWarningDisplayOff();
}

template <typename T>
using Image = itk::Image<T, 3>;

// The grid's own memory as an image of ITK, which only reads it.
template <typename T>
typename Image<T>::Pointer View(const VoxelGrid<T>& grid) {
  SetUpItk();
  auto image = Image<T>::New();
  typename Image<T>::SizeType size;
  std::copy(grid.geometry.size.begin(), grid.geometry.size.end(), size.begin());
  image->SetRegions(typename Image<T>::RegionType(size));
  typename Image<T>::SpacingType spacing;
  spacing.Fill(grid.geometry.spacing_mm);
  image->SetSpacing(spacing);
  image->GetPixelContainer()->SetImportPointer(const_cast<T*>(grid.values.data()),
                                               grid.values.size(), false);
  return image;
}

template <typename T>
VoxelGrid<T> Copy(const Image<T>& image, const GridGeometry& geometry) {
  VoxelGrid<T> grid;
  grid.geometry = geometry;
  const T* values = image.GetBufferPointer();
  grid.values.assign(values, values + geometry.num_voxels());
  return grid;
}

int FilterThreads() {
  return static_cast<int>(itk::MultiThreaderBase::GetGlobalDefaultNumberOfThreads());
}

LabelGrid Complement(const LabelGrid& mask) {
  return MaskWhere(mask, [](uint8_t value) { return value == 0; });
}

bool IsEmpty(const LabelGrid& mask) {
  return std::all_of(mask.values.begin(), mask.values.end(), [](uint8_t v) { return v == 0; });
}

}  // namespace

void SetFilterThreads(int threads) {
  itk::MultiThreaderBase::SetGlobalDefaultNumberOfThreads(static_cast<itk::ThreadIdType>(threads));
}

LabelGrid Components::Mask(int32_t component) const {
  return MaskWhere(labels, [=](int32_t label) { return label == component; });
}

Components LabelComponents(const LabelGrid& mask, Neighbours neighbours, int64_t min_voxels) {
  auto connected = itk::ConnectedComponentImageFilter<Image<uint8_t>, Image<int32_t>>::New();
  connected->SetInput(View(mask));
  connected->SetFullyConnected(neighbours == Neighbours::kCorners);
  auto relabel = itk::RelabelComponentImageFilter<Image<int32_t>, Image<int32_t>>::New();
  relabel->SetInput(connected->GetOutput());
  relabel->SetMinimumObjectSize(static_cast<itk::SizeValueType>(min_voxels));
  relabel->Update();
  Components components;
  components.labels = Copy(*relabel->GetOutput(), mask.geometry);
  const auto sizes = relabel->GetSizeOfObjectsInPixels();
  components.voxels.assign(sizes.begin(), sizes.begin() + relabel->GetNumberOfObjects());
  return components;
}

LabelGrid LargestComponent(const LabelGrid& mask, Neighbours neighbours) {
  return LabelComponents(mask, neighbours).Mask(1);
}

FloatGrid DistanceMm(const LabelGrid& mask) {
  if (IsEmpty(mask)) return FloatGrid(mask.geometry, std::numeric_limits<float>::max());
  const VoxelGrid<int32_t> squares = SquaredDistanceVoxels(mask, FilterThreads());
  FloatGrid distance(mask.geometry);
  const double square_mm2 = mask.geometry.spacing_mm * mask.geometry.spacing_mm;
  std::transform(
      squares.values.begin(), squares.values.end(), distance.values.begin(),
      [=](int32_t square) { return static_cast<float>(std::sqrt(square_mm2 * square)); });
  return distance;
}

// From the border between voxels, half a voxel from the centres on either side of it: the distances
// to the nearest centre beyond, which the filter gives, are by that too long.
FloatGrid SignedDistanceMm(const LabelGrid& mask) {
  FloatGrid inside = DistanceMm(Complement(mask));
  const FloatGrid outside = DistanceMm(mask);
  const auto half = static_cast<float>(mask.geometry.spacing_mm / 2);
  for (size_t i = 0; i < inside.values.size(); ++i) {
    inside.values[i] = mask.values[i] != 0 ? inside.values[i] - half : half - outside.values[i];
  }
  return inside;
}

// By distance, not by a ball of voxels: exact for any radius in mm, and as quick for a large one.
LabelGrid Erode(const LabelGrid& mask, double radius_mm) {
  return MaskWhere(DistanceMm(Complement(mask)), [=](float mm) { return mm > radius_mm; });
}

LabelGrid Dilate(const LabelGrid& mask, double radius_mm) {
  return MaskWhere(DistanceMm(mask), [=](float mm) { return mm <= radius_mm; });
}

LabelGrid Open(const LabelGrid& mask, double radius_mm) {
  return Dilate(Erode(mask, radius_mm), radius_mm);
}

LabelGrid Close(const LabelGrid& mask, double radius_mm) {
  return Erode(Dilate(mask, radius_mm), radius_mm);
}

LabelGrid WatershedFromMarkers(const VoxelGrid<int16_t>& height, const LabelGrid& markers,
                               const LabelGrid& mask) {
  // What is not in the mask is flooded after all that is, and then taken away again.
  VoxelGrid<int16_t> walled = height;
  for (size_t i = 0; i < walled.values.size(); ++i) {
    if (mask.values[i] == 0) walled.values[i] = std::numeric_limits<int16_t>::max();
  }
  auto watershed =
      itk::MorphologicalWatershedFromMarkersImageFilter<Image<int16_t>, Image<uint8_t>>::New();
  watershed->SetInput1(View(walled));
  watershed->SetInput2(View(markers));
  watershed->SetMarkWatershedLine(false);
  watershed->SetFullyConnected(false);
  watershed->Update();
  LabelGrid labels = Copy(*watershed->GetOutput(), mask.geometry);
  for (size_t i = 0; i < labels.values.size(); ++i) {
    if (mask.values[i] == 0) labels.values[i] = 0;
  }
  return labels;
}

FloatGrid GaussianSmooth(const FloatGrid& grid, double sigma_mm) {
  auto gaussian = itk::DiscreteGaussianImageFilter<Image<float>, Image<float>>::New();
  gaussian->SetInput(View(grid));
  gaussian->SetVariance(sigma_mm * sigma_mm);
  gaussian->SetUseImageSpacing(true);
  gaussian->Update();
  return Copy(*gaussian->GetOutput(), grid.geometry);
}

}  // namespace tissueform
