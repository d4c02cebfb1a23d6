// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/predict/slicer_scene.h"

#include <filesystem>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "nlohmann/json.hpp"
#include <Eigen/LU>

#include "core/base/atomic_file.h"
#include "core/base/status_macros.h"
#include "core/mesh/io/tet_mesh_io.h"
#include "core/mesh/io/triangle_mesh_io.h"
#include "core/planning/case_file/mesh_surfaces.h"
#include "core/planning/case_file/parted_skin.h"
#include "core/planning/case_file/skin_follow.h"

namespace tissueform {
namespace {

using Json = nlohmann::ordered_json;

constexpr char kSkinColor[] = "0.86 0.7 0.6";
constexpr char kBoneColor[] = "0.94 0.9 0.8";
constexpr char kSegmentColor[] = "0.55 0.7 0.95";
constexpr char kMagnitudeArray[] = "displacement_magnitude_mm";
constexpr char kMarkupsSchema[] =
    "https://raw.githubusercontent.com/slicer/slicer/master/Modules/Loadable/Markups/Resources/"
    "Schema/markups-schema-v1.0.3.json#";

// Skin, bone and segments, with the displacement of the skin's vertices.
struct Shown {
  CaseSurface skin;
  Positions displacement_mm;  // one row for each vertex of the skin
  std::vector<CaseSurface> others;
  std::vector<CaseLandmark> landmarks;
};

Positions DisplacementOf(const FollowedVertices& follows, const Positions& of_mesh) {
  Positions moved = Positions::Zero(follows.vertices.rows(), 3);
  for (Eigen::Index v = 0; v < moved.rows(); ++v) {
    for (Eigen::Index i = 0; i < 3; ++i) {
      moved.row(v) +=
          static_cast<double>(follows.weights(v, i)) * of_mesh.row(follows.vertices(v, i));
    }
  }
  return moved;
}

void TakeViewer(const PlanProblem& problem, ViewerFile viewer, Shown* shown) {
  const ConstraintSet sticking = StickingRegions(problem);
  for (CaseSurface& surface : viewer.surfaces) {
    if (surface.kind != SurfaceKind::kSkin) {
      shown->others.push_back(std::move(surface));
    } else if (shown->skin.positions.rows() == 0) {
      surface.follows = FollowSkin(surface.positions, surface.triangles, *problem.mesh, sticking);
      PartSkin(*problem.mesh, sticking, problem.constraints.contact(), &surface);
      shown->skin = std::move(surface);
    }
  }
  shown->landmarks = std::move(viewer.landmarks);
}

absl::StatusOr<Shown> WhatIsShown(const PlanProblem& problem, std::optional<ViewerFile> viewer,
                                  const Positions& deformed) {
  Shown shown;
  if (viewer) {
    TakeViewer(problem, *std::move(viewer), &shown);
  } else {
    const ConstraintSet sticking = StickingRegions(problem);
    std::optional<CaseSurface> skin = SkinOfMesh(*problem.mesh, sticking, {});
    if (skin) shown.skin = *std::move(skin);
    shown.others = SegmentsOfMesh(*problem.mesh, sticking);
  }
  if (!shown.skin.follows) {
    return absl::InvalidArgumentError(
        "every vertex of the mesh is fixed or moved: there is no skin to show");
  }
  shown.displacement_mm = DisplacementOf(*shown.skin.follows, deformed - problem.mesh->positions());
  return shown;
}

// Nodes of a scene in MRML, 3D Slicer's format of scenes.
class MrmlScene {
 public:
  // Returns the node's id.
  std::string AddTransform(const std::string& name, const std::string& file) {
    const std::string id = NewId("vtkMRMLLinearTransformNode");
    const std::string storage = NewId("vtkMRMLTransformStorageNode");
    Node("TransformStorage", storage, name, {{"fileName", file}});
    Node("LinearTransform", id, name, {{"references", absl::StrCat("storage:", storage, ";")}});
    return id;
  }

  struct Look {
    const char* color;
    double opacity = 1;
    bool visible = true;
    const char* scalars = "";  // array that is shown in colors
  };
  void AddModel(const std::string& name, const std::string& file, const Look& look,
                const std::string& transform = "") {
    const std::string id = NewId("vtkMRMLModelNode");
    const std::string display = NewId("vtkMRMLModelDisplayNode");
    const std::string storage = NewId("vtkMRMLModelStorageNode");
    const bool has_scalars = *look.scalars != '\0';
    Node("ModelDisplay", display, name,
         {{"color", look.color},
          {"opacity", absl::StrCat(look.opacity)},
          {"visibility", look.visible ? "true" : "false"},
          {"scalarVisibility", has_scalars ? "true" : "false"},
          {"activeScalarName", look.scalars},
          {"references",
           has_scalars ? "color:vtkMRMLColorTableNodeFileColdToHotRainbow.txt;" : ""}});
    // Without this attribute Slicer takes the files of scenes for RAS.
    Node("ModelStorage", storage, name, {{"fileName", file}, {"coordinateSystem", "LPS"}});
    Node("Model", id, name,
         {{"references",
           absl::StrCat("display:", display, ";storage:", storage, ";",
                        transform.empty() ? "" : absl::StrCat("transform:", transform, ";"))}});
  }

  void AddLandmarks(const std::string& name, const std::string& file, bool visible) {
    const std::string id = NewId("vtkMRMLMarkupsFiducialNode");
    const std::string display = NewId("vtkMRMLMarkupsFiducialDisplayNode");
    const std::string storage = NewId("vtkMRMLMarkupsJsonStorageNode");
    Node("MarkupsFiducialDisplay", display, name, {{"visibility", visible ? "true" : "false"}});
    Node("MarkupsJsonStorage", storage, name, {{"fileName", file}, {"coordinateSystem", "LPS"}});
    Node("MarkupsFiducial", id, name,
         {{"references", absl::StrCat("display:", display, ";storage:", storage, ";")}});
  }

  std::string Text() const {
    return absl::StrCat("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<!-- ",
                        kNotMedicalDeviceNotice, " -->\n<MRML version=\"Slicer5\" userTags=\"\">\n",
                        nodes_, "</MRML>\n");
  }

 private:
  using Attributes = std::vector<std::pair<const char*, std::string>>;

  std::string NewId(const std::string& type) { return absl::StrCat(type, ++count_[type]); }

  // Values are our own words, numbers and names of handles, which need no escapes.
  void Node(const char* tag, const std::string& id, const std::string& name,
            const Attributes& attributes) {
    absl::StrAppend(&nodes_, " <", tag, " id=\"", id, "\" name=\"", name, "\"");
    for (const auto& [key, value] : attributes) {
      if (!value.empty()) absl::StrAppend(&nodes_, " ", key, "=\"", value, "\"");
    }
    absl::StrAppend(&nodes_, "></", tag, ">\n");
  }

  std::string nodes_;
  std::map<std::string, int> count_;
};

// Letters, digits, '-' and '_' of a name, which becomes part of file names and of XML.
std::string Plain(const std::string& name) {
  std::string plain;
  for (const char letter : name) {
    const bool keep = absl::ascii_isalnum(static_cast<unsigned char>(letter)) || letter == '-';
    plain.push_back(keep ? letter : '_');
  }
  return plain;
}

class SceneWriterForSlicer {
 public:
  SceneWriterForSlicer(const PlanProblem& problem, const Shown& shown, std::string folder)
      : problem_(problem), shown_(shown), folder_(std::move(folder)) {}

  absl::Status Write() {
    TF_RETURN_IF_ERROR(WriteFace());
    TF_RETURN_IF_ERROR(WriteTransforms());
    TF_RETURN_IF_ERROR(WriteBones());
    TF_RETURN_IF_ERROR(WriteLandmarks());
    return WriteText("scene.mrml", scene_.Text());
  }

 private:
  std::string Path(const std::string& file) const {
    return (std::filesystem::path(folder_) / file).string();
  }
  absl::Status WriteText(const std::string& file, const std::string& text) const {
    return WriteFileAtomically(Path(file), text);
  }

  absl::Status WriteSkin(const std::string& file, const Positions& positions) const {
    const Positions& moved = shown_.displacement_mm;
    const Eigen::VectorXd length = moved.rowwise().norm();
    TF_ASSIGN_OR_RETURN(TriangleMesh mesh, TriangleMesh::Create(positions, shown_.skin.triangles));
    return WriteTriangleMesh(
        Path(file),
        {.mesh = std::move(mesh),
         .point_data = {{"displacement_mm", 3,
                         std::vector<double>(moved.data(), moved.data() + moved.size())},
                        {kMagnitudeArray, 1,
                         std::vector<double>(length.data(), length.data() + length.size())}},
         .cell_data = {},
         .space = FileSpace::kLps});
  }

  absl::Status WriteFace() {
    const Positions before = shown_.skin.positions.cast<double>();
    TF_RETURN_IF_ERROR(WriteSkin("face.vtp", before));
    TF_RETURN_IF_ERROR(WriteSkin("face_predicted.vtp", before + shown_.displacement_mm));
    scene_.AddModel("Face (pre-op)", "face.vtp",
                    {.color = kSkinColor, .opacity = 0.3, .visible = false});
    scene_.AddModel(
        "Face (predicted)", "face_predicted.vtp",
        {.color = kSkinColor, .opacity = 1, .visible = true, .scalars = kMagnitudeArray});
    return absl::OkStatus();
  }

  absl::Status WriteTransforms() {
    for (size_t h = 0; h < problem_.poses.size(); ++h) {
      const std::string& name = problem_.constraints.handles()[h].name;
      // Names may differ only in what Plain replaces.
      std::string base = Plain(name);
      while (!bases_.insert(base).second) base += "_";
      TF_RETURN_IF_ERROR(WriteText(base + ".tfm", ItkTransformText(problem_.poses[h])));
      moves_[name] = {base, scene_.AddTransform(base + " movement", base + ".tfm")};
    }
    return absl::OkStatus();
  }

  absl::Status WriteBones() {
    std::map<std::string, int> count;
    for (const CaseSurface& surface : shown_.others) {
      const auto move = moves_.find(surface.handle);
      const bool moves = move != moves_.end();
      const std::string base = moves ? move->second.base : "bone";
      const int number = ++count[base];
      const std::string file =
          absl::StrCat(base, number > 1 ? absl::StrCat("_", number) : "", ".ply");
      TF_ASSIGN_OR_RETURN(TriangleMesh mesh, TriangleMesh::Create(surface.positions.cast<double>(),
                                                                  surface.triangles));
      TF_RETURN_IF_ERROR(WriteTriangleMesh(
          Path(file),
          {.mesh = std::move(mesh), .point_data = {}, .cell_data = {}, .space = FileSpace::kLps}));
      AddBone(Plain(surface.name), file, moves ? move->second.transform : "");
    }
    return absl::OkStatus();
  }

  void AddBone(const std::string& name, const std::string& file, const std::string& transform) {
    if (transform.empty()) {
      scene_.AddModel(name, file, {.color = kBoneColor});
      return;
    }
    scene_.AddModel(name + " (pre-op)", file,
                    {.color = kBoneColor, .opacity = 0.5, .visible = false});
    scene_.AddModel(name + " (planned)", file, {.color = kSegmentColor}, transform);
  }

  Eigen::Vector3d AfterMove(const CaseLandmark& landmark) const {
    if (landmark.skin_vertex && *landmark.skin_vertex < shown_.displacement_mm.rows()) {
      return landmark.position_mm + shown_.displacement_mm.row(*landmark.skin_vertex).transpose();
    }
    for (size_t h = 0; h < problem_.poses.size(); ++h) {
      if (problem_.constraints.handles()[h].name == landmark.handle) {
        return ApplyPose(problem_.poses[h], landmark.position_mm);
      }
    }
    return landmark.position_mm;
  }

  std::string MarkupsText(bool after) const {
    Json points = Json::array();
    for (const CaseLandmark& landmark : shown_.landmarks) {
      const Eigen::Vector3d place = after ? AfterMove(landmark) : landmark.position_mm;
      points.push_back({{"id", absl::StrCat(points.size() + 1)},
                        {"label", landmark.name},
                        {"description", landmark.label},
                        {"position", {place.x(), place.y(), place.z()}},
                        {"selected", true},
                        {"locked", false},
                        {"visibility", true},
                        {"positionStatus", "defined"}});
    }
    const Json markup = {{"type", "Fiducial"},
                         {"coordinateSystem", "LPS"},
                         {"coordinateUnits", "mm"},
                         {"locked", false},
                         {"controlPoints", points}};
    return Json{{"@schema", kMarkupsSchema},
                {"notice", kNotMedicalDeviceNotice},
                {"markups", {markup}}}
               .dump(2) +
           "\n";
  }

  absl::Status WriteLandmarks() {
    if (shown_.landmarks.empty()) return absl::OkStatus();
    TF_RETURN_IF_ERROR(WriteText("landmarks.mrk.json", MarkupsText(false)));
    TF_RETURN_IF_ERROR(WriteText("landmarks_predicted.mrk.json", MarkupsText(true)));
    scene_.AddLandmarks("Landmarks (pre-op)", "landmarks.mrk.json", false);
    scene_.AddLandmarks("Landmarks (predicted)", "landmarks_predicted.mrk.json", true);
    return absl::OkStatus();
  }

  const PlanProblem& problem_;
  const Shown& shown_;
  const std::string folder_;
  MrmlScene scene_;
  struct Move {
    std::string base;       // of the names of the handle's files
    std::string transform;  // id of its node
  };
  std::map<std::string, Move> moves_;  // by handle
  std::set<std::string> bases_ = {"bone", "face", "face_predicted"};
};

}  // namespace

std::string ItkTransformText(const HandlePose& pose) {
  const Eigen::Matrix3d moves = pose.scale * RotationMatrix(pose.rotation_vector);
  const Eigen::Vector3d offset = ApplyPose(pose, Eigen::Vector3d::Zero());
  const Eigen::Matrix3d back = moves.inverse();
  const Eigen::Vector3d shift = -(back * offset);
  std::string text =
      absl::StrCat("#Insight Transform File V1.0\n# ", kNotMedicalDeviceNotice,
                   "\n#Transform 0\nTransform: AffineTransform_double_3_3\nParameters:");
  for (Eigen::Index row = 0; row < 3; ++row) {
    for (Eigen::Index column = 0; column < 3; ++column) {
      absl::StrAppendFormat(&text, " %.17g", back(row, column));
    }
  }
  for (const double mm : shift) absl::StrAppendFormat(&text, " %.17g", mm);
  return text + "\nFixedParameters: 0 0 0\n";
}

absl::Status WriteSlicerScene(const PlanProblem& problem, std::optional<ViewerFile> viewer,
                              const Positions& deformed, const std::string& folder) {
  TF_ASSIGN_OR_RETURN(const Shown shown, WhatIsShown(problem, std::move(viewer), deformed));
  return SceneWriterForSlicer(problem, shown, folder).Write();
}

}  // namespace tissueform
