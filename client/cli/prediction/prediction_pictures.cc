// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/prediction/prediction_pictures.h"

#include <array>
#include <cmath>
#include <iterator>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

#include "core/base/atomic_folder.h"
#include "core/base/status_macros.h"
#include "core/planning/rendering/figure.h"

namespace tissueform {
namespace {

struct PictureSize {
  int width = 0;
  int row_height = 0;
};
constexpr PictureSize kSkinAlone{1200, 700};
// With title and last line 1024 high.
constexpr PictureSize kWithBone{1024, 467};

const Colour kFixedBone{0.90, 0.87, 0.78};
const Colour kTeeth{0.97, 0.96, 0.92};
// What a title has room for, in bytes; beyond that it counts the segments.
constexpr size_t kMaxMoveText = 45;

// Axes of the head: x to the patient's left, y to the back, z up.
struct NamedView {
  const char* file;
  const char* of_face;
  const char* of_anything;
  std::array<double, 3> from;
};
constexpr std::array<NamedView, 3> kViews = {
    {{"front.png", "from the front", "along y", {0, -1, 0}},
     {"left.png", "from the patient's left", "along x", {1, 0, 0}},
     {"three_quarter.png", "three-quarter view", "oblique", {0.75, -1, 0.1}}}};

SurfaceLayer Smooth(const Positions& positions, const TriangleIndices& facets,
                    const Colour& colour) {
  SurfaceLayer layer;
  layer.positions = positions;
  layer.triangles = facets;
  layer.colour = colour;
  layer.edges = false;
  layer.smooth = true;
  return layer;
}

// Panels of one view share a camera: all keep room for all.
class PanelMaker {
 public:
  PanelMaker(const BeforeAndAfter& what, const NamedView& view) {
    const Eigen::Matrix3d to_lps = what.head_frame.ToLps();
    scene_.view.from = to_lps * Eigen::Vector3d(view.from.data());
    scene_.view.up = to_lps.col(2);
    scene_.room_for.resize(what.rest.rows() + what.deformed.rows(), 3);
    scene_.room_for << what.rest, what.deformed;
    scene_.room_for_legend = true;
  }

  Scene Make(const std::string& title, std::vector<SurfaceLayer> layers) const {
    Scene scene = scene_;
    scene.title = title;
    scene.surfaces = std::move(layers);
    return scene;
  }

 private:
  Scene scene_;
};

// 1, 2 or 5 times a power of ten, so that the bar's labels are short.
double BarEnd(double largest_mm) {
  if (largest_mm <= 0) return 1;
  const double unit = std::pow(10.0, std::floor(std::log10(largest_mm)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (largest_mm <= factor * unit) return factor * unit;
  }
  return 10 * unit;
}

Figure FigureOf(const BeforeAndAfter& what, const NamedView& view) {
  const PanelMaker panels(what, view);
  SurfaceLayer movement = Smooth(what.deformed, what.skin, kTissueColour);
  movement.vertex_values = (what.deformed - what.rest).rowwise().norm();
  const ColourBar bar{"movement of the skin [mm]", 0, BarEnd(movement.vertex_values.maxCoeff())};
  const PictureSize size = what.bone.empty() ? kSkinAlone : kWithBone;
  Figure figure(absl::StrCat(what.move, ", ", what.is_face ? view.of_face : view.of_anything),
                size.width);
  Scene before = panels.Make("before", {Smooth(what.rest, what.skin, kTissueColour)});
  Scene moved = panels.Make(what.bone.empty() ? "after (predicted)" : "movement (predicted)",
                            {std::move(movement)});
  moved.colour_bar = bar;
  if (what.bone.empty()) {
    figure.AddRow(size.row_height, {std::move(before), std::move(moved)});
    return figure;
  }
  figure.AddRow(size.row_height, {std::move(before),
                                  panels.Make("after (predicted)",
                                              {Smooth(what.deformed, what.skin, kTissueColour)})});
  figure.AddRow(size.row_height,
                {std::move(moved), panels.Make("bone after (planned)", what.bone)});
  return figure;
}

// "Lower jaw 8.0 mm and 2.1°": of its pivot, as a planner states it.
std::string MoveInTitle(const CaseHandle& handle, const HandlePose& pose) {
  const double mm = (ApplyPose(pose, handle.pivot_mm) - handle.pivot_mm).norm();
  const double deg = pose.rotation_vector.norm() * 180 / M_PI;
  std::string text = absl::StrFormat("%s %.1f mm", handle.label, mm);
  if (deg >= 0.05) absl::StrAppendFormat(&text, " and %.1f°", deg);
  return text;
}

std::string MovesInTitle(const CaseFile& contents, const std::map<std::string, HandlePose>& poses) {
  std::vector<std::string> moves;
  for (const CaseHandle& handle : contents.handles) {
    const auto pose = poses.find(handle.name);
    if (pose == poses.end()) continue;
    moves.push_back(MoveInTitle(handle, pose->second));
  }
  std::string text = absl::StrJoin(moves, "; ");
  if (text.size() <= kMaxMoveText) return text;
  return absl::StrCat(moves.size(), moves.size() == 1 ? " segment moved" : " segments moved");
}

// One of a few, in the order of the handles.
Colour HandleColour(const CaseFile& contents, const std::string& handle) {
  const std::array<Colour, 3> colours = {kBlue, kOrange, kGreen};
  for (size_t h = 0; h < contents.handles.size(); ++h) {
    if (contents.handles[h].name == handle) return colours.at(h % colours.size());
  }
  return kFixedBone;
}

void AppendSkin(const CaseSurface& surface, const Positions& after, BeforeAndAfter* what) {
  const Eigen::Index vertices = what->rest.rows();
  const Eigen::Index triangles = what->skin.rows();
  what->rest.conservativeResize(vertices + after.rows(), 3);
  what->rest.bottomRows(after.rows()) = surface.positions.cast<double>();
  what->deformed.conservativeResize(vertices + after.rows(), 3);
  what->deformed.bottomRows(after.rows()) = after;
  what->skin.conservativeResize(triangles + surface.triangles.rows(), 3);
  what->skin.bottomRows(surface.triangles.rows()) =
      surface.triangles.array() + static_cast<int32_t>(vertices);
}

}  // namespace

std::vector<std::string> BeforeAndAfterPictures() {
  std::vector<std::string> names;
  names.reserve(std::size(kViews));
  for (const NamedView& view : kViews) names.emplace_back(view.file);
  return names;
}

absl::StatusOr<BeforeAndAfter> BeforeAndAfterOfCase(
    const CaseFile& contents, const PredictedCase& predicted,
    const std::map<std::string, HandlePose>& poses) {
  BeforeAndAfter what;
  what.head_frame = contents.head_frame;
  what.move = MovesInTitle(contents, poses);
  what.is_face = !contents.skin_regions.empty();
  for (size_t s = 0; s < contents.surfaces.size(); ++s) {
    const CaseSurface& surface = contents.surfaces[s];
    const Positions after = predicted.surfaces[s].cast<double>();
    if (surface.kind != SurfaceKind::kSkin) {
      const Colour colour =
          surface.kind == SurfaceKind::kTeeth ? kTeeth : HandleColour(contents, surface.handle);
      what.bone.push_back(Smooth(after, surface.triangles, colour));
    } else {
      AppendSkin(surface, after, &what);
    }
  }
  if (what.rest.rows() > 0) return what;
  return absl::InvalidArgumentError("the case does not have skin to draw");
}

absl::Status DrawBeforeAndAfter(const BeforeAndAfter& what, const std::string& folder) {
  for (const NamedView& view : kViews) {
    TF_RETURN_IF_ERROR(FigureOf(what, view).WritePng(absl::StrCat(folder, "/", view.file)));
  }
  return absl::OkStatus();
}

absl::Status WriteBeforeAndAfter(const BeforeAndAfter& what, const std::string& folder) {
  TF_ASSIGN_OR_RETURN(AtomicFolder hidden, AtomicFolder::Create(folder));
  TF_RETURN_IF_ERROR(DrawBeforeAndAfter(what, hidden.path()));
  return hidden.Publish();
}

}  // namespace tissueform
