// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/rendering/figure.h"

#include <algorithm>
#include <utility>
#include <vtkNew.h>
#include <vtkRenderWindow.h>
#include <vtkRenderer.h>
#include <vtkSmartPointer.h>
#include <vtkTextActor.h>
#include <vtkTextProperty.h>
#include <vtkWindowToImageFilter.h>

#include "absl/strings/str_cat.h"

#include "core/base/atomic_file.h"
#include "core/base/status_macros.h"
#include "core/planning/rendering/chart_renderer.h"
#include "core/planning/rendering/indexed_png.h"
#include "core/planning/rendering/picture_renderer.h"
#include "core/planning/rendering/scene_renderer.h"

namespace tissueform {
namespace {

constexpr int kTitleHeight = 56;
constexpr int kFooterHeight = 34;
constexpr char kFooter[] = "Tissueform - research software, not a medical device";

// Renderers in the window, placed in pixels from its upper left corner.
class Page {
 public:
  Page(int width_px, int height_px) : width_px_(width_px), height_px_(height_px) {
    window_->SetOffScreenRendering(1);
    window_->SetMultiSamples(4);
    window_->SetSize(width_px, height_px);
  }

  void Place(vtkRenderer* renderer, int left, int top, int width, int height) {
    const double bottom = height_px_ - top - height;
    renderer->SetViewport(1.0 * left / width_px_, bottom / height_px_,
                          1.0 * (left + width) / width_px_, (bottom + height) / height_px_);
    renderer->SetBackground(1, 1, 1);
    window_->AddRenderer(renderer);
  }

  absl::Status Write(const std::string& path) {
    window_->Render();
    vtkNew<vtkWindowToImageFilter> grabber;
    grabber->SetInput(window_);
    grabber->SetInputBufferTypeToRGB();
    grabber->ReadFrontBufferOff();
    grabber->Update();
    TF_ASSIGN_OR_RETURN(const std::string png, EncodeIndexedPng(grabber->GetOutput()));
    return WriteFileAtomically(path, png);
  }

 private:
  int width_px_;
  int height_px_;
  vtkNew<vtkRenderWindow> window_;
};

enum class TextPlace { kTopLeft, kMiddle };

void AddText(const std::string& text, TextPlace place, int size, vtkRenderer* renderer) {
  vtkNew<vtkTextActor> actor;
  actor->SetInput(text.c_str());
  actor->GetTextProperty()->SetColor(0, 0, 0);
  actor->GetTextProperty()->SetFontSize(size);
  actor->GetPositionCoordinate()->SetCoordinateSystemToNormalizedViewport();
  if (place == TextPlace::kMiddle) {
    actor->GetTextProperty()->SetJustificationToCentered();
    actor->GetTextProperty()->SetVerticalJustificationToCentered();
    actor->SetPosition(0.5, 0.5);
  } else {
    actor->GetTextProperty()->SetVerticalJustificationToTop();
    actor->SetPosition(0.02, 0.98);
  }
  renderer->AddActor2D(actor);
}

void PlaceLine(const std::string& text, int font_size, int top, int width, int height, Page* page) {
  vtkNew<vtkRenderer> renderer;
  AddText(text, TextPlace::kMiddle, font_size, renderer);
  page->Place(renderer, 0, top, width, height);
}

std::vector<vtkSmartPointer<vtkRenderer>> RenderPanels(const std::vector<Scene>& scenes,
                                                       double aspect) {
  double half_height = 0;
  for (const Scene& scene : scenes) {
    half_height = std::max(half_height, HalfHeightToHold(scene, aspect));
  }
  std::vector<vtkSmartPointer<vtkRenderer>> renderers;
  renderers.reserve(scenes.size());
  for (const Scene& scene : scenes) renderers.push_back(RenderScene(scene, half_height));
  return renderers;
}

std::vector<vtkSmartPointer<vtkRenderer>> RenderPanels(const std::vector<Chart>& charts,
                                                       double /*aspect*/) {
  std::vector<vtkSmartPointer<vtkRenderer>> renderers;
  renderers.reserve(charts.size());
  for (const Chart& chart : charts) renderers.push_back(RenderChart(chart));
  return renderers;
}

std::vector<vtkSmartPointer<vtkRenderer>> RenderPanels(const std::vector<Picture>& pictures,
                                                       double aspect) {
  std::vector<vtkSmartPointer<vtkRenderer>> renderers;
  renderers.reserve(pictures.size());
  for (const Picture& picture : pictures) renderers.push_back(RenderPicture(picture, aspect));
  return renderers;
}

}  // namespace

Figure::Figure(std::string title, int width_px) : title_(std::move(title)), width_px_(width_px) {}

void Figure::AddRow(int height_px, std::vector<Scene> scenes) {
  rows_.push_back({height_px, std::move(scenes)});
}

void Figure::AddRow(int height_px, std::vector<Chart> charts) {
  rows_.push_back({height_px, std::move(charts)});
}

void Figure::AddRow(int height_px, std::vector<Picture> pictures) {
  rows_.push_back({height_px, std::move(pictures)});
}

absl::Status Figure::WritePng(const std::string& path) const {
  int height = kTitleHeight + kFooterHeight;
  for (const Row& row : rows_) height += row.height_px;
  Page page(width_px_, height);
  PlaceLine(title_, 26, 0, width_px_, kTitleHeight, &page);
  int top = kTitleHeight;
  char label = 'a';
  for (const Row& row : rows_) {
    std::visit(
        [&](const auto& panels) {
          const int count = static_cast<int>(panels.size());
          const auto renderers = RenderPanels(panels, 1.0 * width_px_ / count / row.height_px);
          for (int p = 0; p < count; ++p) {
            AddText(absl::StrCat("(", std::string(1, label++), ") ", panels[p].title),
                    TextPlace::kTopLeft, 20, renderers[p]);
            // From edge to edge, so that rounding leaves no column uncovered.
            const int left = width_px_ * p / count;
            page.Place(renderers[p], left, top, width_px_ * (p + 1) / count - left, row.height_px);
          }
        },
        row.panels);
    top += row.height_px;
  }
  PlaceLine(kFooter, 15, top, width_px_, kFooterHeight, &page);
  return page.Write(path);
}

}  // namespace tissueform
