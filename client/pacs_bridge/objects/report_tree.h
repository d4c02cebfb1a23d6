// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <string>

#include "absl/status/status.h"

#include "client/pacs_bridge/objects/dicom_items.h"

class DSRDocument;
class DcmDataset;

namespace tissueform {

// The tree of a Comprehensive SR while it is made, from the top: DCMTK's, which checks that an item
// may stand where it is put. Write reports what fails first.
class ReportTree {
 public:
  explicit ReportTree(const CodedTerm& title);
  ~ReportTree();
  ReportTree(const ReportTree&) = delete;
  ReportTree& operator=(const ReportTree&) = delete;

  // What is added between the two belongs to the container.
  void Open(const CodedTerm& name);
  void Close();

  void AddText(const CodedTerm& name, const std::string& text);  // printable ASCII
  void AddCode(const CodedTerm& name, const CodedTerm& value);
  // In UCUM, to four decimals; `derivation` says of what it is the mean and so on.
  void AddNumber(const CodedTerm& name, double value, const std::string& unit,
                 const CodedTerm& derivation = {});
  // The language, and that a device made it.
  void AddContext(const std::string& device_name, const std::string& device_uid);
  // Another object of the study; what is referred to has to be evidence of the report, too.
  void AddImage(const CodedTerm& name, const std::string& class_uid,
                const std::string& instance_uid);
  void AddReference(const CodedTerm& name, const std::string& class_uid,
                    const std::string& instance_uid);
  void AddEvidence(const std::string& study_uid, const std::string& series_uid,
                   const std::string& class_uid, const std::string& instance_uid);
  // What it was made from, beside that.
  void AddOtherEvidence(const std::string& study_uid, const std::string& series_uid,
                        const std::string& class_uid, const std::string& instance_uid);

  // Errors: Internal: what DCMTK refuses.
  absl::Status Write(DcmDataset* object);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tissueform
