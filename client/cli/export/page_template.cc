// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/export/page_template.h"

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"

#include "core/base/process/child_process.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

constexpr char kTemplateFile[] = "share/tissueform/web/moving-file.html";
constexpr uintmax_t kMaxTemplateBytes = uintmax_t{16} << 20;
constexpr char kEnvelopeMark[] = "@TISSUEFORM-ENVELOPE@";
constexpr char kPayloadMark[] = "@TISSUEFORM-PAYLOAD@";

// What stands before and behind the mark.
absl::StatusOr<std::pair<absl::string_view, absl::string_view>> SplitAt(absl::string_view page,
                                                                        const char* mark) {
  const std::vector<absl::string_view> parts = absl::StrSplit(page, mark);
  if (parts.size() == 2) return std::pair(parts[0], parts[1]);
  return absl::FailedPreconditionError(
      absl::StrCat(kTemplateFile, " has a different version from this program; build or install ",
                   "them together"));
}

}  // namespace

absl::StatusOr<std::string> ReadPageTemplate() {
  const fs::path path = fs::path(ProgramFolder()).parent_path() / kTemplateFile;
  std::error_code error;
  const uintmax_t size = fs::file_size(path, error);
  if (error || size > kMaxTemplateBytes) {
    return absl::NotFoundError(absl::StrCat(
        "the page template for moving files is not at ", path.string(),
        "; build it with deploy/build_web.sh, or install the package tissueform-gateway"));
  }
  std::string page(size, '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(page.data(), static_cast<std::streamsize>(size));
  if (!file) return absl::UnavailableError(absl::StrCat("cannot read all of ", path.string()));
  return page;
}

absl::StatusOr<std::string> FillPageTemplate(absl::string_view page, const SealedPayload& sealed) {
  const auto around_envelope = SplitAt(page, kEnvelopeMark);
  if (!around_envelope.ok()) return around_envelope.status();
  const auto around_payload = SplitAt(around_envelope->second, kPayloadMark);
  if (!around_payload.ok()) return around_payload.status();
  return absl::StrCat(around_envelope->first, sealed.envelope, around_payload->first,
                      absl::Base64Escape(sealed.payload), around_payload->second);
}

}  // namespace tissueform
