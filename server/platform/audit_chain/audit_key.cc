// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/audit_chain/audit_key.h"

#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <memory>
#include <unistd.h>
#include <utility>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include <openssl/evp.h>
#include <openssl/hmac.h>
#include <openssl/rand.h>
#include <sys/stat.h>

namespace tissueform {
namespace {

constexpr size_t kKeyBytes = 32;
constexpr size_t kIdDigits = 16;

// Fails only without memory, or without any OpenSSL provider.
void Demand(bool ok) {
  if (!ok) std::abort();
}

absl::Status DiskError(const std::string& path, const char* what) {
  const std::string message =
      absl::StrCat("audit key ", path, ": ", what, " (", std::strerror(errno), ")");
  if (errno == ENOENT)
    return absl::NotFoundError(message + "; `tissueform audit keygen` makes one");
  if (errno == EEXIST) return absl::AlreadyExistsError(message + "; name another file");
  return absl::UnavailableError(message);
}

}  // namespace

AuditKey::AuditKey(std::string bytes) : bytes_(std::move(bytes)) {}

absl::StatusOr<AuditKey> AuditKey::Read(const std::string& path) {
  const int fd = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (fd < 0) return DiskError(path, "cannot be read");
  const absl::Cleanup close_it = [fd] { close(fd); };
  struct stat status = {};
  if (fstat(fd, &status) != 0) return DiskError(path, "cannot be read");
  if ((status.st_mode & (S_IRWXG | S_IRWXO)) != 0) {
    return absl::FailedPreconditionError(
        absl::StrCat("audit key ", path, ": other users can read or write it; chmod 600 ", path));
  }
  std::array<char, 2 * kKeyBytes + 2> bytes = {};
  const ssize_t count = read(fd, bytes.data(), bytes.size());
  if (count < 0) return DiskError(path, "cannot be read");
  absl::string_view text(bytes.data(), static_cast<size_t>(count));
  if (!text.empty() && text.back() == '\n') text.remove_suffix(1);
  bool is_hex = text.size() == 2 * kKeyBytes;
  for (const char c : text) is_hex = is_hex && absl::ascii_isxdigit(static_cast<unsigned char>(c));
  if (!is_hex) {
    return absl::InvalidArgumentError(
        absl::StrCat("audit key ", path,
                     ": it must be 64 hexadecimal digits and a line feed; create it with "
                     "`tissueform audit keygen` or `openssl rand -hex 32`"));
  }
  return AuditKey(absl::HexStringToBytes(text));
}

absl::Status AuditKey::WriteNew(const std::string& path) {
  std::string bytes(kKeyBytes, '\0');
  Demand(RAND_bytes(reinterpret_cast<unsigned char*>(bytes.data()), kKeyBytes) == 1);
  const std::string text = absl::BytesToHexString(bytes) + "\n";
  const int fd = open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, S_IRUSR | S_IWUSR);
  if (fd < 0) return DiskError(path, "cannot be made");
  const absl::Cleanup close_it = [fd] { close(fd); };
  if (write(fd, text.data(), text.size()) == static_cast<ssize_t>(text.size()) && fsync(fd) == 0) {
    return absl::OkStatus();
  }
  const absl::Status failed = DiskError(path, "cannot be written");
  unlink(path.c_str());
  return failed;
}

std::string AuditKey::Mac(const std::vector<absl::string_view>& parts) const {
  std::string input;
  for (const absl::string_view part : parts) absl::StrAppend(&input, part);
  std::array<unsigned char, EVP_MAX_MD_SIZE> mac = {};
  unsigned int size = 0;
  Demand(HMAC(EVP_sha256(), bytes_.data(), static_cast<int>(bytes_.size()),
              reinterpret_cast<const unsigned char*>(input.data()), input.size(), mac.data(),
              &size) != nullptr);
  return absl::BytesToHexString({reinterpret_cast<const char*>(mac.data()), size});
}

std::string AuditKey::Id() const { return Mac({"tissueform audit key"}).substr(0, kIdDigits); }

}  // namespace tissueform
