// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/readers/gmsh_model.h"

#include <algorithm>
#include <array>
#include <gmsh.h>
#include <limits>
#include <vector>

#include "absl/container/flat_hash_map.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"

#include "core/base/status_macros.h"
#include "core/mesh/readers/raw_mesh.h"

namespace tissueform {
namespace {

namespace gmsh_mesh = gmsh::model::mesh;

constexpr int kLinearTet = 4;  // Gmsh's number of the type

struct Tet {
  size_t number = 0;
  std::array<size_t, 4> nodes{};
  int32_t entity = 0;
  int32_t physical = 0;
};

using RowOfNumber = absl::flat_hash_map<size_t, Eigen::Index>;

absl::Status Open(const std::string& path) {
  // Without the user's configuration and on one thread: the mesh depends on the file alone.
  gmsh::initialize(0, nullptr, /*readConfigFiles=*/false);
  gmsh::option::setNumber("General.Terminal", 0);
  gmsh::option::setNumber("General.NumThreads", 1);
  gmsh::logger::start();
  bool failed = false;
  try {
    gmsh::open(path);
  } catch (...) {  // numbers or texts, by version
    failed = true;
  }
  // The log decides, whether Gmsh threw or not: it also goes on after an error that it has logged.
  std::vector<std::string> log;
  gmsh::logger::get(log);
  for (const std::string& line : log) {
    if (!absl::StartsWith(line, "Error")) continue;
    // A bare "Error loading" comes where numbers end before their count is reached, or go on.
    if (absl::StrContains(line, "Error loading")) {
      return absl::InvalidArgumentError(
          "it is damaged: a count of nodes or elements does not fit the lines that follow it");
    }
    return absl::InvalidArgumentError(
        absl::StrCat("it is damaged (", absl::StrReplaceAll(line, {{path, "the file"}}), ")"));
  }
  return failed ? absl::InvalidArgumentError("it is damaged: Gmsh cannot read it")
                : absl::OkStatus();
}

// How many elements Gmsh says it has found in the file, of all dimensions. Of several with one
// number it keeps one and says nothing; its log ("Info: 12 elements") is the only place where the
// count of the file stands.
int64_t AnnouncedElements() {
  std::vector<std::string> log;
  gmsh::logger::get(log);
  int64_t announced = 0;
  for (const std::string& line : log) {
    const std::vector<absl::string_view> words = absl::StrSplit(line, ' ');
    int64_t count = 0;
    if (words.size() == 3 && words[2] == "elements" && absl::SimpleAtoi(words[1], &count)) {
      announced += count;
    }
  }
  return announced;
}

// How many elements there are, of all dimensions; an error when some were lost.
absl::StatusOr<int64_t> CountElements() {
  std::vector<int> types;
  std::vector<std::vector<size_t>> elements;
  std::vector<std::vector<size_t>> nodes;
  gmsh_mesh::getElements(types, elements, nodes);
  int64_t count = 0;
  for (const auto& of_type : elements) count += static_cast<int64_t>(of_type.size());
  if (count >= AnnouncedElements()) return count;
  return absl::AlreadyExistsError(
      absl::StrCat("it announces ", AnnouncedElements(), " elements, but only ", count,
                   " have a number of their own; renumber them (save the file again from Gmsh)"));
}

absl::Status CheckOnlyLinearTets() {
  std::vector<int> types;
  gmsh_mesh::getElementTypes(types, 3);
  for (const int type : types) {
    if (type == kLinearTet) continue;
    std::string name;
    int dim = 0;
    int order = 0;
    int num_nodes = 0;
    int num_primary_nodes = 0;
    std::vector<double> coordinates;
    gmsh_mesh::getElementProperties(type, name, dim, order, num_nodes, coordinates,
                                    num_primary_nodes);
    return absl::InvalidArgumentError(absl::StrCat(
        "it holds cells of the type \"", name, "\"; only linear tetrahedra (4 nodes) are taken"));
  }
  if (types.empty()) return absl::InvalidArgumentError("it holds no tets");
  return absl::OkStatus();
}

int32_t LowestPhysicalGroup(int entity) {
  std::vector<int> groups;
  gmsh::model::getPhysicalGroupsForEntity(3, entity, groups);
  return groups.empty() ? 0 : *std::min_element(groups.begin(), groups.end());
}

// In the order of their numbers.
std::vector<Tet> CollectTets() {
  std::vector<Tet> tets;
  gmsh::vectorpair entities;
  gmsh::model::getEntities(entities, 3);
  for (const auto& [dim, entity] : entities) {
    std::vector<size_t> numbers;
    std::vector<size_t> nodes;
    gmsh_mesh::getElementsByType(kLinearTet, numbers, nodes, entity);
    const int32_t physical = LowestPhysicalGroup(entity);
    for (size_t t = 0; t < numbers.size(); ++t) {
      Tet tet{numbers[t], {}, entity, physical};
      std::copy_n(nodes.begin() + static_cast<std::ptrdiff_t>(4 * t), 4, tet.nodes.begin());
      tets.push_back(tet);
    }
  }
  std::sort(tets.begin(), tets.end(),
            [](const Tet& a, const Tet& b) { return a.number < b.number; });
  return tets;
}

// Rows of the nodes that a tet uses, in the order of their numbers.
RowOfNumber RowsOfNodes(const std::vector<Tet>& tets) {
  std::vector<size_t> used;
  used.reserve(4 * tets.size());
  for (const Tet& tet : tets) used.insert(used.end(), tet.nodes.begin(), tet.nodes.end());
  std::sort(used.begin(), used.end());
  used.erase(std::unique(used.begin(), used.end()), used.end());
  RowOfNumber rows;
  rows.reserve(used.size());
  for (const size_t number : used) rows.emplace(number, static_cast<Eigen::Index>(rows.size()));
  return rows;
}

Positions CollectPositions(const RowOfNumber& rows) {
  std::vector<size_t> numbers;
  std::vector<double> coordinates;
  std::vector<double> parameters;
  gmsh_mesh::getNodes(numbers, coordinates, parameters, -1, -1, false, false);
  Positions positions(static_cast<Eigen::Index>(rows.size()), 3);
  positions.setConstant(std::numeric_limits<double>::quiet_NaN());
  for (size_t n = 0; n < numbers.size(); ++n) {
    const auto row = rows.find(numbers[n]);
    if (row == rows.end()) continue;
    positions.row(row->second) = Eigen::Map<const Eigen::RowVector3d>(&coordinates[3 * n]);
  }
  return positions;
}

Attribute TetArray(const std::string& name, const std::vector<Tet>& tets, int32_t Tet::*member) {
  std::vector<int32_t> values;
  values.reserve(tets.size());
  for (const Tet& tet : tets) values.push_back(tet.*member);
  return {name, 1, std::move(values)};
}

std::string NameOfView(int view) {
  std::string name;
  gmsh::option::getString(absl::StrCat("View[", gmsh::view::getIndex(view), "].Name"), name);
  return CheckAttributeName(name).ok() ? name : absl::StrCat("gmsh_view_", view);
}

bool IsTaken(const std::vector<Attribute>& attributes, const std::string& name) {
  return std::any_of(attributes.begin(), attributes.end(),
                     [&name](const Attribute& attribute) { return attribute.name == name; });
}

// The first time step of a view that lies on nodes or elements; others (values a corner, lists of
// their own geometry) have no place in a mesh.
void CollectView(int view, const RowOfNumber& nodes, const RowOfNumber& tets, RawMesh* mesh) {
  std::string kind;
  std::vector<size_t> numbers;
  std::vector<std::vector<double>> data;
  double time = 0;
  int components = 0;
  gmsh::view::getModelData(view, 0, kind, numbers, data, time, components);
  const bool on_nodes = kind == "NodeData";
  if ((!on_nodes && kind != "ElementData") || components < 1) return;
  const RowOfNumber& rows = on_nodes ? nodes : tets;
  std::vector<double> values(rows.size() * static_cast<size_t>(components),
                             std::numeric_limits<double>::quiet_NaN());
  for (size_t i = 0; i < numbers.size() && i < data.size(); ++i) {
    const auto row = rows.find(numbers[i]);
    if (row == rows.end() || data[i].size() != static_cast<size_t>(components)) continue;
    std::copy(data[i].begin(), data[i].end(), values.begin() + row->second * components);
  }
  std::vector<Attribute>& attributes = on_nodes ? mesh->point_data : mesh->cell_data;
  std::string name = NameOfView(view);
  if (IsTaken(attributes, name)) absl::StrAppend(&name, "_", view);
  attributes.push_back({name, components, std::move(values)});
}

void CollectArrays(const std::vector<Tet>& tets, const RowOfNumber& nodes, bool is_medit,
                   RawMesh* mesh) {
  if (is_medit) {
    mesh->cell_data.push_back(TetArray("medit_reference", tets, &Tet::entity));
    return;
  }
  mesh->cell_data.push_back(TetArray("gmsh_entity", tets, &Tet::entity));
  const bool has_groups =
      std::any_of(tets.begin(), tets.end(), [](const Tet& tet) { return tet.physical != 0; });
  if (has_groups) mesh->cell_data.push_back(TetArray("gmsh_physical", tets, &Tet::physical));
  RowOfNumber rows;
  for (const Tet& tet : tets) rows.emplace(tet.number, static_cast<Eigen::Index>(rows.size()));
  std::vector<int> views;
  gmsh::view::getTags(views);
  for (const int view : views) CollectView(view, nodes, rows, mesh);
}

}  // namespace

absl::StatusOr<RawMesh> ReadGmshModel(const std::string& path, bool is_medit) {
  TF_RETURN_IF_ERROR(Open(path));
  TF_RETURN_IF_ERROR(CheckOnlyLinearTets());
  TF_ASSIGN_OR_RETURN(const int64_t num_elements, CountElements());
  const std::vector<Tet> tets = CollectTets();
  const RowOfNumber rows = RowsOfNodes(tets);
  RawMesh mesh;
  mesh.positions = CollectPositions(rows);
  mesh.cells.resize(static_cast<Eigen::Index>(tets.size()), 4);
  for (size_t t = 0; t < tets.size(); ++t) {
    for (int corner = 0; corner < 4; ++corner) {
      mesh.cells(static_cast<Eigen::Index>(t), corner) =
          static_cast<int32_t>(rows.at(tets[t].nodes[static_cast<size_t>(corner)]));
    }
  }
  CollectArrays(tets, rows, is_medit, &mesh);
  mesh.left_out_cells = num_elements - mesh.cells.rows();
  return mesh;
}

}  // namespace tissueform
