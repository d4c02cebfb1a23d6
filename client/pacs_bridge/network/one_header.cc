// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/network/one_header.h"

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <memory>

#include "client/pacs_bridge/dicom/dicom_file.h"
#include "client/pacs_bridge/dicom/dicom_uid.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

class LastPath : public InstanceSink {
 public:
  absl::Status Keep(const ReceivedInstance& instance) override {
    path_ = instance.path;
    return absl::OkStatus();
  }
  void AssociationEnded(const EndedAssociation& /*ended*/) override {}
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

// A folder of its own (0700), which goes with all that is in it.
class ScratchFolder {
 public:
  explicit ScratchFolder(const std::string& beside) : name_(beside + ".fetch-XXXXXX") {
    if (mkdtemp(name_.data()) == nullptr) name_.clear();
  }
  ~ScratchFolder() {
    std::error_code error;
    if (!name_.empty()) std::filesystem::remove_all(name_, error);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  const std::string& name() const { return name_; }

 private:
  std::string name_;
};

}  // namespace

absl::Status KeepOneHeader(
    const std::string& path,
    const std::function<absl::Status(const InstanceFolder& folder, InstanceSink* sink)>& fetch) {
  const ScratchFolder scratch(path);
  if (scratch.name().empty()) return absl::ErrnoToStatus(errno, path);
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<InstanceFolder> folder,
                      InstanceFolder::Open({.path = scratch.name(), .watermark_bytes = 0}));
  LastPath last;
  const absl::Status fetched = fetch(*folder, &last);
  if (absl::IsNotFound(fetched) || (fetched.ok() && last.path().empty())) {
    return absl::UnavailableError(
        "the PACS lists an object of this series but does not send it: see its log");
  }
  TF_RETURN_IF_ERROR(fetched);
  return CopyHeaderOnly(last.path(), path);
}

absl::Status CheckDicomUids(std::initializer_list<std::string> uids) {
  if (std::all_of(uids.begin(), uids.end(), [](const auto& uid) { return IsDicomUid(uid); })) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError("a UID of study, series or object is invalid");
}

}  // namespace tissueform
