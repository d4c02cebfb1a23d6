// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <chrono>
#include <memory>
#include <string>
#include <thread>

#include "absl/status/statusor.h"
#include "grpcpp/security/tls_certificate_provider.h"

#include "core/base/certificates.h"
#include "core/base/mutex.h"

namespace tissueform {

// A file without a name, which only this process can open; its content is replaced as a whole.
class PrivateFile {
 public:
  // Errors: Internal, when the system has none.
  static absl::StatusOr<std::unique_ptr<PrivateFile>> Make(const std::string& content);
  ~PrivateFile();
  PrivateFile(const PrivateFile&) = delete;
  PrivateFile& operator=(const PrivateFile&) = delete;

  // Opens to the newest content.
  std::string path() const;
  absl::Status Replace(const std::string& content);

 private:
  PrivateFile() = default;

  int fd_ = -1;
  int versions_ = 0;
};

// Certificates, key and authorities that are renewed by rewriting their files while the process
// runs. gRPC's own watcher takes any content of a file and answers no handshake while that is
// invalid: so it watches copies in memory, which only receive checked contents.
//
// Thread-safe.
class RotatedFiles {
 public:
  // Reads and checks all of them, and looks every second whether they have changed until it is
  // destroyed. A new content that is invalid is logged, counted, and not used.
  //
  // Errors: those of ReadTlsFiles and CheckTlsContents. REQUIRES: at least one file is named.
  static absl::StatusOr<std::unique_ptr<RotatedFiles>> Load(const TlsFiles& paths);
  ~RotatedFiles();

  // Must not be asked for anything new when this is gone: end servers and channels first.
  const std::shared_ptr<grpc::experimental::CertificateProviderInterface>& provider() const {
    return provider_;
  }
  bool has_identity() const { return identity_ != nullptr; }
  bool has_roots() const { return roots_ != nullptr; }

  // When the certificate in use ends; the epoch without one.
  std::chrono::system_clock::time_point expiry() const { return expiry_; }
  // What stands in the files cannot be used: the one before is.
  bool alarm() const { return alarm_; }
  // New certificates or authorities that were taken into use.
  int rotations() const { return rotations_; }

 private:
  explicit RotatedFiles(TlsFiles paths) : paths_(std::move(paths)) {}

  absl::Status Use(const TlsContents& contents);
  void Watch();
  // Once a day when the certificate ends soon.
  void LogExpiry();
  // OK: what stands in the files is in use.
  absl::Status LookAgain();

  // Constant after Load.
  const TlsFiles paths_;
  std::unique_ptr<PrivateFile>
      identity_;  // chain and key together: no reader sees half of a change
  std::unique_ptr<PrivateFile> roots_;
  std::shared_ptr<grpc::experimental::CertificateProviderInterface> provider_;

  // Self-synchronised.
  std::atomic<std::chrono::system_clock::time_point> expiry_{};
  std::atomic<bool> alarm_ = false;
  std::atomic<int> rotations_ = 0;

  // The thread's.
  TlsContents used_;
  std::chrono::system_clock::time_point expiry_logged_at_ = {};

  Mutex mutex_;
  ConditionVariable ending_;
  bool ends_ ABSL_GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace tissueform
