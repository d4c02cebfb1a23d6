// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/rendering/chart_renderer.h"

#include <algorithm>
#include <vtkAxis.h>
#include <vtkChartLegend.h>
#include <vtkChartXY.h>
#include <vtkContextActor.h>
#include <vtkContextScene.h>
#include <vtkDoubleArray.h>
#include <vtkNew.h>
#include <vtkPen.h>
#include <vtkPlot.h>
#include <vtkTable.h>
#include <vtkTextProperty.h>

namespace tissueform {
namespace {

constexpr int kFontSize = 18;

vtkSmartPointer<vtkTable> MakeTable(const Curve& curve) {
  vtkNew<vtkDoubleArray> x;
  vtkNew<vtkDoubleArray> y;
  x->SetName("x");
  y->SetName(curve.name.c_str());
  for (const double value : curve.x) x->InsertNextValue(value);
  for (const double value : curve.y) y->InsertNextValue(value);
  auto table = vtkSmartPointer<vtkTable>::New();
  table->AddColumn(x);
  table->AddColumn(y);
  return table;
}

int PenStyle(CurveStyle style) {
  switch (style) {
    case CurveStyle::kDashed:
      return vtkPen::DASH_LINE;
    case CurveStyle::kDotted:
      return vtkPen::DOT_LINE;
    case CurveStyle::kSolid:
      break;
  }
  return vtkPen::SOLID_LINE;
}

void SetFonts(vtkAxis* axis) {
  axis->GetTitleProperties()->SetFontSize(kFontSize);
  axis->GetTitleProperties()->BoldOff();
  axis->GetLabelProperties()->SetFontSize(kFontSize);
  axis->GetGridPen()->SetColor(225, 225, 225);
}

void DemandRange(const Chart& chart, vtkAxis* axis) {
  if (chart.y_low == chart.y_high) return;
  double low = chart.y_low;
  double high = chart.y_high;
  for (const Curve& curve : chart.curves) {
    for (const double y : curve.y) {
      low = std::min(low, y);
      high = std::max(high, y);
    }
  }
  axis->SetBehavior(vtkAxis::FIXED);
  axis->SetRange(low, high);
}

}  // namespace

vtkSmartPointer<vtkRenderer> RenderChart(const Chart& chart) {
  vtkNew<vtkChartXY> plot_area;
  for (const Curve& curve : chart.curves) {
    vtkPlot* plot = plot_area->AddPlot(vtkChart::LINE);
    plot->SetInputData(MakeTable(curve), 0, 1);
    plot->GetPen()->SetColorF(Colour(curve.colour).data());
    plot->SetWidth(2.5F);
    plot->GetPen()->SetLineType(PenStyle(curve.style));
  }
  plot_area->SetShowLegend(true);
  plot_area->GetLegend()->SetLabelSize(kFontSize);
  plot_area->GetLegend()->SetInline(false);
  vtkAxis* x_axis = plot_area->GetAxis(vtkAxis::BOTTOM);
  vtkAxis* y_axis = plot_area->GetAxis(vtkAxis::LEFT);
  SetFonts(x_axis);
  SetFonts(y_axis);
  x_axis->SetTitle(chart.x_title);
  y_axis->SetTitle(chart.y_title);
  y_axis->SetLogScale(chart.logarithmic_y);
  DemandRange(chart, y_axis);
  // Room for the panel's label and title, which the figure draws.
  plot_area->SetTitle(" ");
  plot_area->GetTitleProperties()->SetFontSize(30);

  vtkNew<vtkContextActor> actor;
  actor->GetScene()->AddItem(plot_area);
  auto renderer = vtkSmartPointer<vtkRenderer>::New();
  renderer->AddActor(actor);
  actor->GetScene()->SetRenderer(renderer);
  return renderer;
}

}  // namespace tissueform
