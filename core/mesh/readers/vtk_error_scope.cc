// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/readers/vtk_error_scope.h"

#include <vtkLogger.h>
#include <vtkObjectFactory.h>
#include <vtkOutputWindow.h>
#include <vtkSmartPointer.h>

#include "absl/strings/ascii.h"

namespace tissueform {
namespace {

thread_local VtkErrorScope* current_scope = nullptr;

// Hands texts to the scope of the thread that raised them; without a scope VTK's own window prints
// them.
class ScopedOutputWindow : public vtkOutputWindow {
 public:
  static ScopedOutputWindow* New();
  using Superclass = vtkOutputWindow;

  void DisplayErrorText(const char* text) override {
    if (current_scope == nullptr) return Superclass::DisplayErrorText(text);
    current_scope->Add(text);
  }
  void DisplayWarningText(const char* text) override {
    if (current_scope == nullptr) Superclass::DisplayWarningText(text);
  }
  void DisplayGenericWarningText(const char* text) override {
    if (current_scope == nullptr) Superclass::DisplayGenericWarningText(text);
  }
};
vtkStandardNewMacro(ScopedOutputWindow);

// VTK reports everything twice: to its output window and to its logger, which prints to stderr.
void InstallOutputWindowOnce() {
  static const bool installed = [] {
    vtkLogger::SetStderrVerbosity(vtkLogger::VERBOSITY_OFF);
    vtkOutputWindow::SetInstance(vtkSmartPointer<ScopedOutputWindow>::New());
    return true;
  }();
  static_cast<void>(installed);
}

// "ERROR: In /.../vtkXMLReader.cxx, line 9\nvtkXMLReader (0x5): Text\n\n" becomes "Text".
std::string CleanText(absl::string_view text) {
  if (const size_t address_end = text.find("): "); address_end != text.npos) {
    text.remove_prefix(address_end + 3);
  }
  std::string line(text);
  for (char& c : line) {
    if (absl::ascii_iscntrl(static_cast<unsigned char>(c))) c = ' ';
  }
  absl::RemoveExtraAsciiWhitespace(&line);
  return line;
}

}  // namespace

VtkErrorScope::VtkErrorScope() {
  InstallOutputWindowOnce();
  current_scope = this;
}

VtkErrorScope::~VtkErrorScope() { current_scope = nullptr; }

void VtkErrorScope::Add(const char* text) {
  if (first_error_.empty()) first_error_ = CleanText(text);
}

}  // namespace tissueform
