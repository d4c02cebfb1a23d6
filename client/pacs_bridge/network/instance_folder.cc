// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/network/instance_folder.h"

#include <filesystem>
#include <unistd.h>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include <openssl/sha.h>

#include "client/pacs_bridge/dicom/dicom_uid.h"
#include "client/pacs_bridge/network/dataset_equality.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

constexpr absl::string_view kPartial = ".partial";
absl::Status CheckAnnounced(const AnnouncedInstance& announced, const InstanceHeader& header) {
  if ((announced.instance_uid.empty() || announced.instance_uid == header.instance_uid) &&
      (announced.class_uid.empty() || announced.class_uid == header.class_uid)) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError("the data set has another object or class than the request");
}

}  // namespace

absl::StatusOr<std::unique_ptr<InstanceFolder>> InstanceFolder::Open(
    const InstanceFolderOptions& options) {
  std::error_code error;
  if (!fs::is_directory(options.path, error)) {
    return absl::NotFoundError(absl::StrCat(options.path, ": there is no such folder; make it"));
  }
  if (access(options.path.c_str(), W_OK | X_OK) != 0) {
    return absl::FailedPreconditionError(absl::StrCat(options.path, ": cannot be written to"));
  }
  for (const fs::directory_entry& entry : fs::directory_iterator(options.path, error)) {
    if (absl::EndsWith(entry.path().native(), kPartial)) fs::remove(entry.path(), error);
  }
  return std::unique_ptr<InstanceFolder>(new InstanceFolder(options));
}

absl::Status InstanceFolder::CheckRoom(int64_t bytes) const {
  std::error_code error;
  const fs::space_info space = fs::space(options_.path, error);
  if (!error && static_cast<int64_t>(space.available) - bytes >= options_.watermark_bytes) {
    return absl::OkStatus();
  }
  return absl::ResourceExhaustedError(
      absl::StrCat(options_.path, ": less than ", options_.watermark_bytes,
                   " bytes would be free on the disk; free some space or lower the watermark"));
}

absl::StatusOr<PartialFile> InstanceFolder::NewPartial() const {
  return PartialFile::Create(absl::StrCat(options_.path, "/", NewDicomUid(), kPartial));
}

std::string InstanceFolder::NameOf(absl::string_view instance_uid) const {
  std::string digest(SHA256_DIGEST_LENGTH, '\0');
  SHA256(reinterpret_cast<const unsigned char*>(instance_uid.data()), instance_uid.size(),
         reinterpret_cast<unsigned char*>(digest.data()));
  return absl::StrCat(options_.path, "/", absl::BytesToHexString(digest));
}

absl::StatusOr<ReceivedInstance> InstanceFolder::Take(PartialFile partial,
                                                      const AnnouncedInstance& announced,
                                                      InstanceSink* sink) const {
  ReceivedInstance instance;
  TF_ASSIGN_OR_RETURN(instance.header, ReadInstanceHeader(partial.path(), options_.limits));
  TF_RETURN_IF_ERROR(CheckAnnounced(announced, instance.header));
  std::error_code error;
  instance.bytes = static_cast<int64_t>(fs::file_size(partial.path(), error));
  instance.calling_ae = announced.calling_ae;
  instance.address = announced.address;
  instance.association = announced.association;
  const std::string name = NameOf(instance.header.instance_uid);
  instance.path = absl::StrCat(name, ".dcm");
  if (fs::exists(instance.path, error)) {
    instance.novelty = DatasetsAreEqual(partial.path(), instance.path)
                           ? ReceivedInstance::Novelty::kReplayed
                           : ReceivedInstance::Novelty::kChanged;
  }
  if (instance.novelty == ReceivedInstance::Novelty::kReplayed) {
    TF_RETURN_IF_ERROR(sink->Keep(instance));
    return instance;
  }
  if (instance.novelty == ReceivedInstance::Novelty::kChanged) {
    instance.path = absl::StrCat(name, "-", NewDicomUid(), ".dcm");
  }
  TF_RETURN_IF_ERROR(partial.Publish(instance.path));
  if (absl::Status kept = sink->Keep(instance); !kept.ok()) {
    fs::remove(instance.path, error);
    return kept;
  }
  return instance;
}

}  // namespace tissueform
