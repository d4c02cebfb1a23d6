// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/client/cli/predict/itk_transform.h"

#include <itkTransform.h>
#include <itkTransformFileReader.h>
#include <itkTxtTransformIOFactory.h>
#include <limits>

namespace tissueform::testing {

std::array<double, 3> MapByItk(const std::string& path, const std::array<double, 3>& place) {
  itk::TxtTransformIOFactory::RegisterOneFactory();
  const auto reader = itk::TransformFileReaderTemplate<double>::New();
  reader->SetFileName(path);
  reader->Update();
  const auto* list = reader->GetTransformList();
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  if (list->size() != 1) return {kNone, kNone, kNone};
  const auto* transform = dynamic_cast<itk::Transform<double, 3, 3>*>(list->front().GetPointer());
  if (transform == nullptr) return {kNone, kNone, kNone};
  itk::Point<double, 3> point;
  for (unsigned i = 0; i < 3; ++i) point[i] = place[i];
  const auto mapped = transform->TransformPoint(point);
  return {mapped[0], mapped[1], mapped[2]};
}

}  // namespace tissueform::testing
