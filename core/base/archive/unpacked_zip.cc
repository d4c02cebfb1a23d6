// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/archive/unpacked_zip.h"

#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <type_traits>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"

#include "core/base/process/helper_call.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

constexpr char kProgram[] = "tissueform-unzip";
constexpr char kWhat[] = "unpacking the zip";
constexpr int64_t kMaxAnswerBytes = 1 << 20;

struct UnzipRequest {
  std::string path;
  std::string folder;
  ZipLimits limits;
};

absl::StatusOr<UnzipRequest> ReceiveRequest(PipeReceiver* receiver) {
  UnzipRequest request;
  TF_ASSIGN_OR_RETURN(request.path, receiver->Text());
  TF_ASSIGN_OR_RETURN(request.folder, receiver->Text());
  static_assert(std::is_trivially_copyable_v<ZipLimits>);
  TF_RETURN_IF_ERROR(receiver->Bytes(&request.limits, sizeof(request.limits)));
  return request;
}

absl::StatusOr<std::string> PrivateFolder(const std::string& parent) {
  std::string folder = (fs::path(parent) / ".unpacked-XXXXXX").string();
  if (mkdtemp(folder.data()) == nullptr) {
    return absl::ErrnoToStatus(errno, "cannot create a folder to unpack the zip in");
  }
  return folder;
}

}  // namespace

bool IsZip(const std::string& path) {
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return false;
  if (absl::EndsWithIgnoreCase(path, ".zip")) return true;
  char start[4] = {};
  std::ifstream(path, std::ios::binary).read(start, sizeof(start));
  const absl::string_view magic(start, sizeof(start));
  return magic == "PK\x03\x04" || magic == "PK\x05\x06";
}

absl::StatusOr<UnpackedZip> UnpackedZip::Unpack(const std::string& path, const std::string& parent,
                                                const ZipLimits& limits) {
  TF_ASSIGN_OR_RETURN(std::string folder, PrivateFolder(parent));
  UnpackedZip unpacked(std::move(folder));
  const std::string absolute = fs::absolute(path).string();
  const absl::Status status = CallHelper(
      {.program = kProgram,
       .what = kWhat,
       .limits = {limits.max_memory_bytes, limits.max_seconds, limits.max_bytes}},
      [&](PipeSender* request) {
        request->Text(absolute);
        request->Text(unpacked.folder());
        request->Bytes(&limits, sizeof(limits));
      },
      [](int descriptor) { return PipeReceiver(descriptor, kMaxAnswerBytes).Outcome(); });
  if (status.ok()) return unpacked;
  // "cannot use the zip: entry 3 is encrypted", "cannot use the zip: it is empty".
  const bool of_entry = absl::StartsWith(status.message(), "entry ");
  return absl::Status(
      status.code(), absl::StrCat("cannot use the zip: ", of_entry ? "" : "it ", status.message()));
}

UnpackedZip::~UnpackedZip() {
  std::error_code error;
  if (!folder_.empty()) fs::remove_all(folder_, error);
}

UnpackedZip::UnpackedZip(UnpackedZip&& other) noexcept
    : folder_(std::exchange(other.folder_, std::string())) {}

int RunUnzip(const std::function<absl::Status(const std::string& path, const std::string& folder,
                                              const ZipLimits& limits)>& unpack) {
  return RunHelperProgram(
      [&unpack](const IsolationLimits& limits, PipeReceiver* receiver, PipeSender* answer) {
        answer->Outcome(WithoutExceptions(kWhat, limits, [&]() -> absl::Status {
          TF_ASSIGN_OR_RETURN(const UnzipRequest request, ReceiveRequest(receiver));
          return unpack(request.path, request.folder, request.limits);
        }));
      });
}

}  // namespace tissueform
