// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/rendering/scene_renderer.h"

#include <algorithm>
#include <limits>
#include <vtkActor.h>
#include <vtkArrowSource.h>
#include <vtkCamera.h>
#include <vtkCellArray.h>
#include <vtkCellData.h>
#include <vtkDoubleArray.h>
#include <vtkGlyph3D.h>
#include <vtkLightKit.h>
#include <vtkLookupTable.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkPolyDataMapper.h>
#include <vtkPolyDataNormals.h>
#include <vtkProperty.h>
#include <vtkScalarBarActor.h>
#include <vtkTextProperty.h>
#include <vtkUnsignedCharArray.h>

#include <Eigen/Geometry>

namespace tissueform {
namespace {

// A box round what is seen, in the directions of the picture.
struct Extent {
  Eigen::Vector3d right;
  Eigen::Vector3d up;
  Eigen::Vector3d towards;  // the observer
  Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::max());
  Eigen::Vector3d high = Eigen::Vector3d::Constant(std::numeric_limits<double>::lowest());

  explicit Extent(const View& view)
      : right(view.up.cross(view.from).normalized()),
        up(view.from.cross(right).normalized()),
        towards(view.from.normalized()) {}

  void Add(const Positions& positions) {
    for (Eigen::Index v = 0; v < positions.rows(); ++v) {
      const Eigen::Vector3d position = positions.row(v);
      const Eigen::Vector3d seen(right.dot(position), up.dot(position), towards.dot(position));
      low = low.cwiseMin(seen);
      high = high.cwiseMax(seen);
    }
  }

  Eigen::Vector3d Middle() const {
    const Eigen::Vector3d seen = (low + high) / 2;
    return right * seen.x() + up * seen.y() + towards * seen.z();
  }
};

Extent ExtentOf(const Scene& scene) {
  Extent extent(scene.view);
  for (const SurfaceLayer& surface : scene.surfaces) extent.Add(surface.positions);
  for (const ArrowLayer& arrows : scene.arrows) {
    extent.Add(arrows.origins);
    extent.Add(arrows.origins + arrows.directions);
  }
  extent.Add(scene.room_for);
  return extent;
}

bool HasRoomForLegend(const Scene& scene) {
  return scene.room_for_legend || !scene.colour_bar.title.empty();
}

vtkSmartPointer<vtkPoints> MakePoints(const Positions& positions) {
  auto points = vtkSmartPointer<vtkPoints>::New();
  points->SetNumberOfPoints(positions.rows());
  for (Eigen::Index v = 0; v < positions.rows(); ++v) {
    points->SetPoint(v, positions(v, 0), positions(v, 1), positions(v, 2));
  }
  return points;
}

vtkSmartPointer<vtkPolyData> MakePolyData(const SurfaceLayer& surface) {
  vtkNew<vtkCellArray> triangles;
  for (Eigen::Index f = 0; f < surface.triangles.rows(); ++f) {
    const vtkIdType corners[3] = {surface.triangles(f, 0), surface.triangles(f, 1),
                                  surface.triangles(f, 2)};
    triangles->InsertNextCell(3, corners);
  }
  auto data = vtkSmartPointer<vtkPolyData>::New();
  data->SetPoints(MakePoints(surface.positions));
  data->SetPolys(triangles);
  return data;
}

vtkSmartPointer<vtkUnsignedCharArray> MakeColours(const std::vector<Colour>& colours) {
  auto array = vtkSmartPointer<vtkUnsignedCharArray>::New();
  array->SetNumberOfComponents(3);
  for (const Colour& colour : colours) {
    array->InsertNextTuple3(255 * colour.x(), 255 * colour.y(), 255 * colour.z());
  }
  return array;
}

// As many values as there are colours: bands show where the field is steep.
vtkSmartPointer<vtkLookupTable> TableOf(const ColourBar& bar) {
  auto table = vtkSmartPointer<vtkLookupTable>::New();
  table->SetNumberOfTableValues(kMapColours);
  table->SetTableRange(bar.low, bar.high);
  for (vtkIdType band = 0; band < kMapColours; ++band) {
    const Colour& colour = MapColours()[static_cast<size_t>(band)];
    table->SetTableValue(band, colour.x(), colour.y(), colour.z());
  }
  return table;
}

// Normals at the vertices; edges sharper than that stay edges.
vtkSmartPointer<vtkPolyData> WithNormals(vtkPolyData* data) {
  constexpr double kCreaseDegrees = 60;
  vtkNew<vtkPolyDataNormals> normals;
  normals->SetInputData(data);
  normals->SetFeatureAngle(kCreaseDegrees);
  normals->ConsistencyOff();
  normals->Update();
  return normals->GetOutput();
}

vtkSmartPointer<vtkActor> SurfaceActor(const SurfaceLayer& surface, vtkLookupTable* table) {
  const auto data = MakePolyData(surface);
  vtkNew<vtkPolyDataMapper> mapper;
  mapper->ScalarVisibilityOff();
  if (surface.vertex_values.size() > 0) {
    vtkNew<vtkDoubleArray> values;
    for (const double value : surface.vertex_values) values->InsertNextValue(value);
    data->GetPointData()->SetScalars(values);
    mapper->SetLookupTable(table);
    mapper->UseLookupTableScalarRangeOn();
    mapper->InterpolateScalarsBeforeMappingOn();
    mapper->ScalarVisibilityOn();
  } else if (!surface.triangle_colours.empty()) {
    data->GetCellData()->SetScalars(MakeColours(surface.triangle_colours));
    mapper->ScalarVisibilityOn();
  }
  mapper->SetInputData(surface.smooth ? WithNormals(data) : data);
  auto actor = vtkSmartPointer<vtkActor>::New();
  actor->SetMapper(mapper);
  vtkProperty* property = actor->GetProperty();
  property->SetColor(Colour(surface.colour).data());
  property->SetOpacity(surface.opacity);
  property->SetInterpolation(surface.smooth ? VTK_PHONG : VTK_FLAT);
  property->SetAmbient(0.25);
  property->SetDiffuse(0.85);
  property->SetEdgeVisibility(surface.edges);
  // Darker than the faces but not black: fine meshes would drown in their edges.
  property->SetEdgeColor(Colour(0.5 * surface.colour).data());
  property->SetLineWidth(0.7F);
  return actor;
}

vtkSmartPointer<vtkActor> ArrowActor(const ArrowLayer& arrows) {
  vtkNew<vtkDoubleArray> directions;
  directions->SetNumberOfComponents(3);
  for (Eigen::Index a = 0; a < arrows.directions.rows(); ++a) {
    directions->InsertNextTuple3(arrows.directions(a, 0), arrows.directions(a, 1),
                                 arrows.directions(a, 2));
  }
  vtkNew<vtkPolyData> data;
  data->SetPoints(MakePoints(arrows.origins));
  data->GetPointData()->SetVectors(directions);
  // The arrow is scaled as a whole, so its shaft is given for the mean length.
  const double mean_length = std::max(arrows.directions.rowwise().norm().mean(), 1e-12);
  vtkNew<vtkArrowSource> shape;
  shape->SetShaftRadius(arrows.thickness_mm / 2 / mean_length);
  shape->SetTipRadius(1.5 * arrows.thickness_mm / mean_length);
  shape->SetTipLength(0.35);
  shape->SetTipResolution(12);
  shape->SetShaftResolution(8);
  vtkNew<vtkGlyph3D> glyphs;
  glyphs->SetInputData(data);
  glyphs->SetSourceConnection(shape->GetOutputPort());
  glyphs->SetVectorModeToUseVector();
  glyphs->SetScaleModeToScaleByVector();
  vtkNew<vtkPolyDataMapper> mapper;
  mapper->SetInputConnection(glyphs->GetOutputPort());
  mapper->ScalarVisibilityOff();
  auto actor = vtkSmartPointer<vtkActor>::New();
  actor->SetMapper(mapper);
  actor->GetProperty()->SetColor(Colour(arrows.colour).data());
  actor->GetProperty()->SetAmbient(0.3);
  return actor;
}

void AddLegend(const ColourBar& bar, vtkLookupTable* table, vtkRenderer* renderer) {
  if (bar.title.empty()) return;
  vtkNew<vtkScalarBarActor> legend;
  legend->SetLookupTable(table);
  legend->SetTitle(bar.title.c_str());
  legend->SetOrientationToHorizontal();
  legend->SetNumberOfLabels(6);
  legend->SetLabelFormat("%.2g");
  legend->UnconstrainedFontSizeOn();
  legend->SetTextPositionToPrecedeScalarBar();
  legend->SetVerticalTitleSeparation(6);
  legend->SetPosition(0.25, 0.01);
  legend->SetWidth(0.5);
  legend->SetHeight(0.2);
  for (vtkTextProperty* text : {legend->GetTitleTextProperty(), legend->GetLabelTextProperty()}) {
    text->SetColor(0, 0, 0);
    text->SetFontSize(18);
    text->ItalicOff();
    text->ShadowOff();
    text->BoldOff();
  }
  renderer->AddActor2D(legend);
}

}  // namespace

double HalfHeightToHold(const Scene& scene, double aspect) {
  constexpr double kRoomForTitle = 1.22;
  constexpr double kRoomForLegend = 0.35;
  const Extent extent = ExtentOf(scene);
  const Eigen::Vector3d size = extent.high - extent.low;
  const double up = kRoomForTitle + (HasRoomForLegend(scene) ? kRoomForLegend : 0);
  return std::max(up * size.y(), 1.06 * size.x() / aspect) / 2;
}

vtkSmartPointer<vtkRenderer> RenderScene(const Scene& scene, double half_height_mm) {
  auto renderer = vtkSmartPointer<vtkRenderer>::New();
  const auto table = TableOf(scene.colour_bar);
  for (const SurfaceLayer& surface : scene.surfaces) {
    renderer->AddActor(SurfaceActor(surface, table));
  }
  for (const ArrowLayer& arrows : scene.arrows) renderer->AddActor(ArrowActor(arrows));
  AddLegend(scene.colour_bar, table, renderer);
  vtkNew<vtkLightKit> lights;
  lights->SetKeyLightIntensity(0.85);
  lights->SetKeyToFillRatio(1.7);
  lights->AddLightsToRenderer(renderer);

  const Extent extent = ExtentOf(scene);
  // A little out of the middle: away from the title, or from the legend where there is one.
  const double shift = (HasRoomForLegend(scene) ? -0.08 : 0.1) * half_height_mm;
  const Eigen::Vector3d middle = extent.Middle() + extent.up * shift;
  const Eigen::Vector3d eye = middle + extent.towards * (extent.high - extent.low).norm() * 2;
  vtkCamera* camera = renderer->GetActiveCamera();
  camera->ParallelProjectionOn();
  camera->SetFocalPoint(middle.data());
  camera->SetPosition(eye.data());
  camera->SetViewUp(extent.up.data());
  camera->SetParallelScale(half_height_mm);
  renderer->ResetCameraClippingRange();
  return renderer;
}

}  // namespace tissueform
