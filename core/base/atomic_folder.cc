// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/atomic_folder.h"

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <unistd.h>
#include <utility>

#include "absl/strings/str_cat.h"
#include <sys/stat.h>

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

// Without links and without a slash at the end, so that it has a name and a folder round it.
fs::path Resolved(const std::string& folder) {
  std::error_code error;
  const fs::path absolute = fs::weakly_canonical(fs::absolute(folder, error), error);
  return absolute.has_filename() ? absolute : absolute.parent_path();
}

absl::Status CannotMake(int error_number, const fs::path& goal) {
  return absl::ErrnoToStatus(error_number,
                             absl::StrCat("cannot create a folder next to ", goal.string(),
                                          "; check permissions and free space"));
}

}  // namespace

absl::Status CheckFillable(const std::string& folder) {
  const fs::path path = Resolved(folder);
  std::error_code error;
  if (fs::exists(path, error) && !(fs::is_directory(path, error) && fs::is_empty(path, error))) {
    return absl::AlreadyExistsError(
        absl::StrCat(folder, " exists and is not an empty folder; name a new one"));
  }
  if (path == fs::current_path(error)) {
    return absl::FailedPreconditionError(
        absl::StrCat(folder, " is the current folder; name a new one"));
  }
  const std::string parent = path.parent_path().string();
  if (!fs::is_directory(parent, error)) {
    return absl::NotFoundError(
        absl::StrCat("there is no folder ", parent, " for ", folder, "; make it first"));
  }
  if (access(parent.c_str(), W_OK | X_OK) != 0) {
    return absl::PermissionDeniedError(
        absl::StrCat("cannot write into ", parent, "; check its permissions"));
  }
  return absl::OkStatus();
}

AtomicFolder::AtomicFolder(std::string goal, std::string hidden, std::string path)
    : goal_(std::move(goal)), hidden_(std::move(hidden)), path_(std::move(path)) {}

AtomicFolder::AtomicFolder(AtomicFolder&& other) noexcept
    : goal_(std::move(other.goal_)),
      hidden_(std::exchange(other.hidden_, {})),
      path_(std::move(other.path_)) {}

// Two folders: mkdtemp creates the outer one so that only its owner may enter. The inner one, which
// is published, gets the permissions of any new folder. Setting them afterwards would require the
// umask, which cannot be read without changing it while other threads may rely on it.
absl::StatusOr<AtomicFolder> AtomicFolder::Create(const std::string& folder) {
  TF_RETURN_IF_ERROR(CheckFillable(folder));
  const fs::path goal = Resolved(folder);
  const std::string name = goal.filename().string();
  std::string hidden = (goal.parent_path() / absl::StrCat(".", name, ".partial-XXXXXX")).string();
  if (mkdtemp(hidden.data()) == nullptr) return CannotMake(errno, goal);
  AtomicFolder made(goal.string(), hidden, absl::StrCat(hidden, "/", name));
  if (mkdir(made.path_.c_str(), 0777) != 0) return CannotMake(errno, goal);
  return made;
}

AtomicFolder::~AtomicFolder() {
  if (hidden_.empty()) return;
  std::error_code error;
  fs::remove_all(hidden_, error);
}

absl::Status AtomicFolder::Publish() {
  // An empty folder that has been there is replaced.
  if (rename(path_.c_str(), goal_.c_str()) != 0) {
    return absl::ErrnoToStatus(
        errno, absl::StrCat("cannot move the result to ", goal_, "; name a new folder"));
  }
  return absl::OkStatus();
}

}  // namespace tissueform
