// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "server/store/postgres_store/postgres_pool.h"
#include "server/store/sql_blobs.h"

namespace tissueform {

// Blobs as rows of 1 MiB. A blob and the row that claims it are written in one transaction and
// deleted in one, so every blob has a claim. Writing or removing a claim locks the blob first.
//
// A damaged blob that is set aside is kept under the name "damaged KEY SHA-256".
class PostgresBlobs final : public SqlBlobs {
 public:
  static constexpr int64_t kPieceBytes = int64_t{1} << 20;

  // `pool` must outlive it.
  explicit PostgresBlobs(PostgresPool* pool) : pool_(pool) {}

  absl::Status Put(const std::string& sha256, const std::vector<absl::string_view>& parts,
                   const SqlWork& claim) override;
  // In an unlinked temporary file until Keep.
  absl::StatusOr<std::unique_ptr<Incoming>> Receive() override;
  absl::Status Read(const FindClaim& find, const Sink& sink) override;
  // An unlinked temporary copy.
  absl::StatusOr<OpenFile> Open(const FindClaim& find) override;
  absl::Status Lock(SqlTransaction& transaction, const std::string& sha256) override;
  absl::Status Remove(const Release& release) override;
  absl::Status SetAside(const std::string& sha256, const absl::Status& damage) override;

 private:
  class IncomingFile;
  // Returns `size` bytes from `offset` on. REQUIRES: the blob has them.
  using Source = std::function<absl::StatusOr<std::string>(int64_t offset, int64_t size)>;

  absl::Status PutFrom(const std::string& sha256, int64_t bytes, const Source& source,
                       const SqlWork& claim);

  PostgresPool* const pool_;
};

}  // namespace tissueform
