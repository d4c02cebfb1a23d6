// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/rendering/picture_renderer.h"

#include <algorithm>
#include <cstring>
#include <vtkCamera.h>
#include <vtkCoordinate.h>
#include <vtkImageActor.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkTextActor.h>
#include <vtkTextProperty.h>

namespace tissueform {
namespace {

vtkSmartPointer<vtkImageData> ToImage(const Picture& picture) {
  auto image = vtkSmartPointer<vtkImageData>::New();
  image->SetDimensions(picture.width, picture.height, 1);
  image->AllocateScalars(VTK_UNSIGNED_CHAR, 3);
  const size_t row_bytes = 3 * static_cast<size_t>(picture.width);
  for (int row = 0; row < picture.height; ++row) {  // VTK counts from the bottom
    std::memcpy(image->GetScalarPointer(0, picture.height - 1 - row, 0),
                picture.rgb.data() + static_cast<size_t>(row) * row_bytes, row_bytes);
  }
  return image;
}

void AddMark(const std::string& text, double x, double y, vtkRenderer* renderer) {
  if (text.empty()) return;
  vtkNew<vtkTextActor> mark;
  mark->SetInput(text.c_str());
  mark->GetTextProperty()->SetColor(1, 0.9, 0.3);
  mark->GetTextProperty()->SetFontSize(22);
  mark->GetTextProperty()->SetBold(true);
  mark->GetTextProperty()->SetJustificationToCentered();
  mark->GetTextProperty()->SetVerticalJustificationToCentered();
  mark->GetPositionCoordinate()->SetCoordinateSystemToWorld();
  mark->GetPositionCoordinate()->SetValue(x, y, 0);
  renderer->AddActor2D(mark);
}

}  // namespace

vtkSmartPointer<vtkRenderer> RenderPicture(const Picture& picture, double aspect) {
  constexpr double kRoomForTitle = 0.09;  // of the panel's height
  auto renderer = vtkSmartPointer<vtkRenderer>::New();
  vtkNew<vtkImageActor> actor;
  actor->SetInputData(ToImage(picture));
  renderer->AddActor(actor);

  const double width = picture.width - 1.0;
  const double height = picture.height - 1.0;
  const double margin = 0.04 * std::max(width, height);
  AddMark(picture.at_left, margin, height / 2, renderer);
  AddMark(picture.at_right, width - margin, height / 2, renderer);
  AddMark(picture.at_top, width / 2, height - margin, renderer);
  AddMark(picture.at_bottom, width / 2, margin, renderer);

  const double panel_height = std::max(height / (1 - 1.2 * kRoomForTitle), 1.02 * width / aspect);
  const double middle = height / 2 + panel_height * kRoomForTitle / 2;
  vtkCamera* camera = renderer->GetActiveCamera();
  camera->ParallelProjectionOn();
  camera->SetFocalPoint(width / 2, middle, 0);
  camera->SetPosition(width / 2, middle, 1000);
  camera->SetViewUp(0, 1, 0);
  camera->SetParallelScale(panel_height / 2);
  renderer->ResetCameraClippingRange();
  return renderer;
}

}  // namespace tissueform
