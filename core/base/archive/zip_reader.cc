// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/archive/zip_reader.h"

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <fcntl.h>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <unistd.h>
#include <utility>
#include <vector>
#include <zip.h>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include <sys/stat.h>

#include "core/base/archive/zip_names.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kBlockBytes = 1 << 18;
constexpr zip_uint32_t kUnixModeShift = 16;

using Archive = std::unique_ptr<zip_t, decltype(&zip_discard)>;
using OpenEntry = std::unique_ptr<zip_file_t, decltype(&zip_fclose)>;

struct Entry {
  zip_uint64_t index = 0;
  int64_t bytes = 0;  // unpacked
  std::vector<std::string> parts;
};

// Of the zip or of one of its entries.
absl::Status Damaged(absl::string_view what) {
  return absl::InvalidArgumentError(
      absl::StrCat("is damaged or not complete (", what, "); copy or export the zip again"));
}

absl::StatusOr<Archive> Open(const std::string& path) {
  int code = 0;
  Archive archive(zip_open(path.c_str(), ZIP_RDONLY, &code), zip_discard);
  if (archive) return archive;
  if (code == ZIP_ER_NOZIP) return Damaged("it has no list of files at its end");
  if (code == ZIP_ER_OPEN || code == ZIP_ER_READ) {
    return absl::InvalidArgumentError("cannot be read; check its permissions");
  }
  return Damaged("its list of files does not fit the rest");
}

// Links and devices of Unix; other systems have none.
bool IsPlainFile(zip_t* archive, zip_uint64_t index) {
  zip_uint8_t system = 0;
  zip_uint32_t attributes = 0;
  if (zip_file_get_external_attributes(archive, index, 0, &system, &attributes) != 0) return true;
  const auto kind = (attributes >> kUnixModeShift) & S_IFMT;
  return system != ZIP_OPSYS_UNIX || kind == 0 || kind == S_IFREG || kind == S_IFDIR;
}

// Nothing for a folder and for what is left out.
absl::StatusOr<std::optional<Entry>> CheckEntry(zip_t* archive, zip_uint64_t index,
                                                const ZipLimits& limits) {
  zip_stat_t stat;
  zip_stat_init(&stat);
  const char* name = zip_get_name(archive, index, ZIP_FL_ENC_GUESS);
  if (name == nullptr || zip_stat_index(archive, index, 0, &stat) != 0 ||
      (stat.valid & ZIP_STAT_SIZE) == 0 || (stat.valid & ZIP_STAT_COMP_METHOD) == 0) {
    return absl::InvalidArgumentError("is not described");
  }
  TF_ASSIGN_OR_RETURN(std::vector<std::string> parts,
                      PartsOfZipName(name, limits.max_folder_depth));
  const bool is_folder = absl::EndsWith(name, "/") || absl::EndsWith(name, "\\");
  if (is_folder || parts.empty() || IsSystemClutter(parts)) return std::nullopt;
  if (!IsPlainFile(archive, index)) {
    return absl::InvalidArgumentError("is a link or a device, not a file");
  }
  if ((stat.valid & ZIP_STAT_ENCRYPTION_METHOD) != 0 && stat.encryption_method != ZIP_EM_NONE) {
    return absl::InvalidArgumentError(
        "is encrypted; unpack the zip with its password, and name the folder");
  }
  if (stat.comp_method != ZIP_CM_STORE && stat.comp_method != ZIP_CM_DEFLATE) {
    return absl::InvalidArgumentError(
        "is compressed by a method other than deflate; pack it again as a plain zip");
  }
  if (stat.size > static_cast<zip_uint64_t>(limits.max_bytes)) {
    return absl::ResourceExhaustedError(absl::StrCat("has more than ", limits.max_bytes, " bytes"));
  }
  return Entry{index, static_cast<int64_t>(stat.size), std::move(parts)};
}

absl::Status OfEntry(zip_uint64_t index, const absl::Status& status) {
  return {status.code(), absl::StrCat("entry ", index + 1, " ", status.message())};
}

absl::Status CheckSizes(const std::vector<Entry>& entries, int64_t zip_bytes,
                        const ZipLimits& limits) {
  if (entries.empty()) return absl::InvalidArgumentError("is empty: it holds no files");
  if (static_cast<int>(entries.size()) > limits.max_files) {
    return absl::ResourceExhaustedError(absl::StrCat("holds ", entries.size(), " files; at most ",
                                                     limits.max_files, " are unpacked"));
  }
  int64_t bytes = 0;
  for (const Entry& entry : entries) {
    bytes += entry.bytes;
    if (bytes > limits.max_bytes) {
      return absl::ResourceExhaustedError(absl::StrCat("holds files of more than ",
                                                       limits.max_bytes,
                                                       " bytes, the limit for zips; unpack it, "
                                                       "and name the folder"));
    }
  }
  if (bytes > kRatioFreeBytes && bytes / std::max<int64_t>(zip_bytes, 1) > limits.max_ratio) {
    return absl::ResourceExhaustedError(absl::StrCat(
        "would grow to ", bytes / std::max<int64_t>(zip_bytes, 1), " times its size, more than ",
        limits.max_ratio, " times: this is a zip bomb"));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<Entry>> CheckAll(zip_t* archive, int64_t zip_bytes,
                                            const ZipLimits& limits) {
  const zip_int64_t count = zip_get_num_entries(archive, 0);
  std::vector<Entry> entries;
  std::set<std::vector<std::string>> names;
  for (zip_uint64_t index = 0; index < static_cast<zip_uint64_t>(std::max<zip_int64_t>(count, 0));
       ++index) {
    absl::StatusOr<std::optional<Entry>> entry = CheckEntry(archive, index, limits);
    if (!entry.ok()) return OfEntry(index, entry.status());
    if (!entry->has_value()) continue;
    if (!names.insert((*entry)->parts).second) {
      return OfEntry(index, absl::InvalidArgumentError("has the name of an earlier one"));
    }
    entries.push_back(**std::move(entry));
  }
  TF_RETURN_IF_ERROR(CheckSizes(entries, zip_bytes, limits));
  return entries;
}

absl::Status WriteAll(int file, const char* data, int64_t size) {
  while (size > 0) {
    const ssize_t written = write(file, data, static_cast<size_t>(size));
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return absl::ErrnoToStatus(errno, "cannot be written");
    data += written;
    size -= written;
  }
  return absl::OkStatus();
}

bool IsNestedZip(absl::string_view start) {
  return absl::StartsWith(start, "PK\x03\x04") || absl::StartsWith(start, "PK\x05\x06");
}

// Copies an opened entry. The sizes that a zip states are not trusted.
absl::Status Copy(zip_file_t* from, int to, int64_t expected_bytes) {
  std::vector<char> block(kBlockBytes);
  int64_t copied = 0;
  for (;;) {
    const zip_int64_t got = zip_fread(from, block.data(), block.size());
    if (got < 0) return Damaged("it cannot be unpacked");
    if (got == 0) break;
    if (copied == 0 && IsNestedZip({block.data(), static_cast<size_t>(got)})) {
      return absl::InvalidArgumentError(
          "is a zip itself; unpack the outer zip, and name the inner one");
    }
    copied += got;
    if (copied > expected_bytes) return Damaged("it is larger than stated");
    TF_RETURN_IF_ERROR(WriteAll(to, block.data(), got));
  }
  return copied == expected_bytes ? absl::OkStatus() : Damaged("it is smaller than stated");
}

absl::StatusOr<std::string> MakePath(const std::string& folder, const Entry& entry) {
  fs::path path(folder);
  for (size_t i = 0; i + 1 < entry.parts.size(); ++i) path /= entry.parts[i];
  std::error_code error;
  fs::create_directories(path, error);
  if (error) return absl::InvalidArgumentError("is in a folder that is a file, too");
  return (path / entry.parts.back()).string();
}

absl::Status Extract(zip_t* archive, const Entry& entry, const std::string& folder) {
  TF_ASSIGN_OR_RETURN(const std::string path, MakePath(folder, entry));
  const OpenEntry from(zip_fopen_index(archive, entry.index, 0), zip_fclose);
  if (!from) return Damaged("it cannot be opened");
  const int to = open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0600);
  if (to < 0) return absl::ErrnoToStatus(errno, "cannot be created");
  const absl::Cleanup close_file = [to] { close(to); };
  return Copy(from.get(), to, entry.bytes);
}

}  // namespace

absl::Status ReadZip(const std::string& path, const std::string& folder, const ZipLimits& limits) {
  std::error_code error;
  const auto zip_bytes = static_cast<int64_t>(fs::file_size(path, error));
  if (error) return absl::InvalidArgumentError("cannot be read; check its permissions");
  TF_ASSIGN_OR_RETURN(const Archive archive, Open(path));
  TF_ASSIGN_OR_RETURN(const std::vector<Entry> entries, CheckAll(archive.get(), zip_bytes, limits));
  for (const Entry& entry : entries) {
    if (const absl::Status status = Extract(archive.get(), entry, folder); !status.ok()) {
      return OfEntry(entry.index, status);
    }
  }
  return absl::OkStatus();
}

}  // namespace tissueform
