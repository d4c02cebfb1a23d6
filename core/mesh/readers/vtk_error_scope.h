// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

namespace tissueform {

// While one exists, what VTK reports on this thread is collected instead of printed to stderr.
// VTK's errors reach it from every object, also from helpers that offer no place for an observer.
// Scopes do not nest.
class VtkErrorScope {
 public:
  VtkErrorScope();
  ~VtkErrorScope();
  VtkErrorScope(const VtkErrorScope&) = delete;
  VtkErrorScope& operator=(const VtkErrorScope&) = delete;

  // The first error in one line, without source position and address; empty if no error occurred.
  const std::string& first_error() const { return first_error_; }

  // Called by VTK's output window.
  void Add(const char* text);

 private:
  std::string first_error_;
};

}  // namespace tissueform
