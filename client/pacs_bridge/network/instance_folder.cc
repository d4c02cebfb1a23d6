// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/network/instance_folder.h"

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <unistd.h>
#include <utility>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include <openssl/sha.h>

#include "client/pacs_bridge/dicom/dicom_uid.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

constexpr absl::string_view kPartial = ".partial";
constexpr size_t kPieceBytes = 1 << 18;

// Where the data set begins: after the preamble and the meta header, whose first element
// (0002,0000) says how long the rest of it is. What senders write in there differs, also for one
// object.
std::streamoff DataSetBegin(std::ifstream* file) {
  constexpr std::streamoff kMeta = 132;
  constexpr std::streamoff kFirst = 12;
  unsigned char first[kFirst] = {};
  file->seekg(kMeta);
  if (!file->read(reinterpret_cast<char*>(first), kFirst)) return 0;
  if (std::memcmp(first, "\x02\x00\x00\x00UL\x04\x00", 8) != 0) return 0;
  const uint32_t length =
      first[8] | first[9] << 8 | first[10] << 16 | static_cast<uint32_t>(first[11]) << 24;
  return kMeta + kFirst + length;
}

bool SameDataSet(const std::string& one, const std::string& other) {
  std::ifstream files[2] = {std::ifstream(one, std::ios::binary),
                            std::ifstream(other, std::ios::binary)};
  for (std::ifstream& file : files) {
    const std::streamoff begin = DataSetBegin(&file);
    file.clear();
    file.seekg(begin);
  }
  std::vector<char> pieces[2] = {std::vector<char>(kPieceBytes), std::vector<char>(kPieceBytes)};
  while (true) {
    files[0].read(pieces[0].data(), kPieceBytes);
    files[1].read(pieces[1].data(), kPieceBytes);
    const auto count = static_cast<size_t>(files[0].gcount());
    if (files[1].gcount() != files[0].gcount() ||
        std::memcmp(pieces[0].data(), pieces[1].data(), count) != 0) {
      return false;
    }
    if (count < kPieceBytes) return true;
  }
}

absl::Status CheckAnnounced(const AnnouncedInstance& announced, const InstanceHeader& header) {
  if ((announced.instance_uid.empty() || announced.instance_uid == header.instance_uid) &&
      (announced.class_uid.empty() || announced.class_uid == header.class_uid)) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      "the data set is of another object or class than the request says");
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
                   " bytes would be free on the disk; make room or lower the watermark"));
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
    instance.novelty = SameDataSet(partial.path(), instance.path)
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
