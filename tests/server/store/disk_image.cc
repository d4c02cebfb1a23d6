// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <filesystem>
#include <fstream>

#include "absl/strings/str_cat.h"

#include "tests/server/store/disk_recorder.h"

namespace tissueform {
namespace {

std::string FolderOf(const std::string& path) {
  const size_t slash = path.rfind('/');
  return slash == std::string::npos ? "" : path.substr(0, slash);
}

// Entries of `names` that lie directly in `folder`, without changing the others.
template <typename Container, typename PathOf>
void EraseIn(Container* names, const std::string& folder, PathOf path_of) {
  for (auto next = names->begin(); next != names->end();) {
    next = FolderOf(path_of(*next)) == folder ? names->erase(next) : std::next(next);
  }
}

const std::string& PathOfFile(const std::pair<const std::string, int>& file) { return file.first; }
const std::string& PathOfFolder(const std::string& folder) { return folder; }

}  // namespace

void DiskImage::ApplyTo(const DiskOp& op, std::string* bytes) {
  if (op.kind == DiskOp::Kind::kTruncate) {
    bytes->resize(static_cast<size_t>(op.offset));
    return;
  }
  const auto offset = static_cast<size_t>(op.offset);
  if (bytes->size() < offset + op.bytes.size()) bytes->resize(offset + op.bytes.size());
  bytes->replace(offset, op.bytes.size(), op.bytes);
}

void DiskImage::SyncNames(const std::string& folder) {
  EraseIn(&durable_.files, folder, PathOfFile);
  EraseIn(&durable_.folders, folder, PathOfFolder);
  for (const auto& file : now_.files) {
    if (FolderOf(file.first) == folder) durable_.files.insert(file);
  }
  for (const std::string& path : now_.folders) {
    if (FolderOf(path) == folder) durable_.folders.insert(path);
  }
}

void DiskImage::Apply(const DiskOp& op) {
  switch (op.kind) {
    case DiskOp::Kind::kMark:
      break;
    case DiskOp::Kind::kCreate:
      now_.files[op.path] = op.file;
      files_[op.file];
      break;
    case DiskOp::Kind::kWrite:
    case DiskOp::Kind::kTruncate:
      ApplyTo(op, &files_[op.file].now);
      files_[op.file].pending.push_back(op);
      break;
    case DiskOp::Kind::kSyncFile:
      files_[op.file].durable = files_[op.file].now;
      files_[op.file].pending.clear();
      break;
    case DiskOp::Kind::kRename:
      now_.files[op.new_path] = now_.files[op.path];
      now_.files.erase(op.path);
      break;
    case DiskOp::Kind::kLink:
      now_.files[op.new_path] = now_.files[op.path];
      break;
    case DiskOp::Kind::kRemove:
      now_.files.erase(op.path);
      break;
    case DiskOp::Kind::kMakeFolder:
      now_.folders.insert(op.path);
      break;
    case DiskOp::Kind::kSyncFolder:
      SyncNames(op.path);
      break;
  }
}

bool DiskImage::HasWorkFor(const DiskOp& sync) const {
  if (sync.kind == DiskOp::Kind::kSyncFile) return !files_.at(sync.file).pending.empty();
  DiskImage after = *this;
  after.SyncNames(sync.path);
  return after.durable_.files != durable_.files || after.durable_.folders != durable_.folders;
}

void DiskImage::WriteAfterCut(const std::string& folder, Kept kept) const {
  // In order: a folder before what lies in it.
  for (const std::string& path : durable_.folders) {
    const std::filesystem::path made = absl::StrCat(folder, "/", path);
    if (!std::filesystem::exists(made.parent_path())) continue;  // that was lost
    std::filesystem::create_directory(made);
    std::filesystem::permissions(made, std::filesystem::perms::owner_all);
  }
  for (const auto& [path, number] : durable_.files) {
    const std::filesystem::path made = absl::StrCat(folder, "/", path);
    if (!std::filesystem::exists(made.parent_path())) continue;
    const File& file = files_.at(number);
    std::string bytes = file.durable;
    if (kept == Kept::kLastOfEachFile && !file.pending.empty()) {
      ApplyTo(file.pending.back(), &bytes);
    }
    std::ofstream(made, std::ios::binary) << bytes;
  }
}

}  // namespace tissueform
