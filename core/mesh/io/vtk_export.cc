// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/io/vtk_export.h"

#include <cstring>
#include <set>
#include <vtkCellArray.h>
#include <vtkCellData.h>
#include <vtkDataArray.h>
#include <vtkDoubleArray.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkSmartPointer.h>
#include <vtkTypeTraits.h>
#include <vtkUnsignedCharArray.h>
#include <vtkXMLPolyDataWriter.h>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/string_view.h"

#include "core/base/status_macros.h"
#include "core/mesh/io/tet_mesh_io.h"
#include "core/mesh/readers/raw_mesh.h"
#include "core/mesh/readers/vtk_error_scope.h"

namespace tissueform {
namespace {

absl::Status CheckAttribute(const Attribute& attribute, Eigen::Index num_tuples) {
  TF_RETURN_IF_ERROR(CheckAttributeName(attribute.name));
  const size_t size =
      std::visit([](const auto& values) { return values.size(); }, attribute.values);
  if (attribute.components < 1 || size != static_cast<size_t>(attribute.components * num_tuples)) {
    return absl::InvalidArgumentError(absl::StrCat("array \"", attribute.name, "\" holds ", size,
                                                   " values, not ", attribute.components, " times ",
                                                   num_tuples));
  }
  return absl::OkStatus();
}

// VTK 9.1 writes names as they are, although its reader undoes the escapes of XML.
std::string EscapeForXml(const std::string& name) {
  return absl::StrReplaceAll(name,
                             {{"&", "&amp;"}, {"<", "&lt;"}, {">", "&gt;"}, {"\"", "&quot;"}});
}

vtkSmartPointer<vtkDataArray> ToVtk(const Attribute& attribute) {
  return std::visit(
      [&attribute](const auto& values) {
        using Value = typename std::decay_t<decltype(values)>::value_type;
        auto array = vtkSmartPointer<vtkDataArray>::Take(
            vtkDataArray::CreateDataArray(vtkTypeTraits<Value>::VTK_TYPE_ID));
        array->SetName(EscapeForXml(attribute.name).c_str());
        array->SetNumberOfComponents(attribute.components);
        array->SetNumberOfTuples(static_cast<vtkIdType>(values.size()) / attribute.components);
        std::memcpy(array->GetVoidPointer(0), values.data(), values.size() * sizeof(Value));
        return array;
      },
      attribute.values);
}

// As the codes of its letters: VTK has arrays of strings, but meshio stops at a file that holds
// one.
void AddNotice(vtkPointSet* data) {
  const absl::string_view letters = kNotMedicalDeviceNotice;
  vtkNew<vtkUnsignedCharArray> notice;
  notice->SetName("notice");
  notice->SetNumberOfTuples(static_cast<vtkIdType>(letters.size()));
  std::memcpy(notice->GetPointer(0), letters.data(), letters.size());
  data->GetFieldData()->AddArray(notice);
}

// The same for a person who opens the file as text; VTK's writer cannot write a comment.
std::string WithNoticeAsComment(std::string xml) {
  const size_t end_of_declaration = xml.find("?>\n");
  if (end_of_declaration == xml.npos) return xml;
  return xml.insert(end_of_declaration + 3,
                    absl::StrCat("<!-- ", kNotMedicalDeviceNotice, " -->\n"));
}

}  // namespace

absl::Status CheckAttributes(const std::vector<Attribute>& attributes, Eigen::Index num_tuples) {
  std::set<std::string> names;
  for (const Attribute& attribute : attributes) {
    TF_RETURN_IF_ERROR(CheckAttribute(attribute, num_tuples));
    if (!names.insert(attribute.name).second) {
      return absl::InvalidArgumentError(
          absl::StrCat("two arrays are named \"", attribute.name, "\""));
    }
  }
  return absl::OkStatus();
}

void AddPointsAndArrays(const Positions& positions, const std::vector<Attribute>& point_data,
                        const std::vector<Attribute>& cell_data, vtkPointSet* data) {
  vtkNew<vtkDoubleArray> coordinates;
  coordinates->SetNumberOfComponents(3);
  coordinates->SetNumberOfTuples(positions.rows());
  std::memcpy(coordinates->GetPointer(0), positions.data(),
              static_cast<size_t>(positions.size()) * sizeof(double));
  vtkNew<vtkPoints> points;
  points->SetData(coordinates);
  data->SetPoints(points);
  for (const Attribute& attribute : point_data) data->GetPointData()->AddArray(ToVtk(attribute));
  for (const Attribute& attribute : cell_data) data->GetCellData()->AddArray(ToVtk(attribute));
  AddNotice(data);
}

absl::StatusOr<std::string> SerializeWith(vtkXMLWriter* writer, vtkPointSet* data) {
  VtkErrorScope errors;
  writer->SetInputData(data);
  // In base64: raw bytes would take a quarter less, but such a file is not XML, and meshio 5.0,
  // which reassembles it by its offsets, takes one array for another where an old offset and a new
  // one happen to be equal. At the end: inside its element VTK notes the range of an array, and its
  // own reader refuses that note where a value is infinite.
  writer->SetDataModeToAppended();
  writer->EncodeAppendedDataOn();
  writer->SetCompressorTypeToZLib();
  // The fastest: files grow by a few per cent, higher levels take longer than many predictions.
  writer->SetCompressionLevel(1);
  writer->WriteToOutputStringOn();
  const int written = writer->Write();
  if (written == 0 || writer->GetErrorCode() != 0 || !errors.first_error().empty()) {
    return absl::InternalError(absl::StrCat("VTK's writer failed (", errors.first_error(), ")"));
  }
  return WithNoticeAsComment(writer->GetOutputString());
}

absl::StatusOr<std::string> VtpText(const TriangleMeshFile& file) {
  TF_RETURN_IF_ERROR(CheckAttributes(file.point_data, file.mesh.num_vertices()));
  TF_RETURN_IF_ERROR(CheckAttributes(file.cell_data, file.mesh.num_triangles()));
  vtkNew<vtkPolyData> surface;
  vtkNew<vtkCellArray> polygons;
  polygons->AllocateExact(file.mesh.num_triangles(), 3 * file.mesh.num_triangles());
  for (const auto& triangle : file.mesh.triangles().rowwise()) {
    polygons->InsertNextCell({triangle[0], triangle[1], triangle[2]});
  }
  surface->SetPolys(polygons);
  AddPointsAndArrays(file.mesh.positions(), file.point_data, file.cell_data, surface);
  vtkNew<vtkXMLPolyDataWriter> writer;
  return SerializeWith(writer, surface);
}

}  // namespace tissueform
