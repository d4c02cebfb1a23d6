// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace tissueform {

// A server that is the only one to write to its store writes under this epoch: a store on disk is
// locked by it.
inline constexpr int64_t kSoleEpoch = 1;

// Which sessions this server may answer and write: all of a store of its own, or those that it
// holds of one that it shares with others.
//
// Thread-safe.
class SessionOwnership {
 public:
  virtual ~SessionOwnership() = default;

  // Other servers use the store as well: sessions come, change and go without this one.
  virtual bool is_shared() const = 0;

  // Takes a session whose record is kept. From then on, until it is lost, this server may answer
  // and write it, under the epoch that is returned; where it holds the session already the epoch
  // stays. Blocks on the store.
  //
  // Errors: Unavailable with SESSION_MOVED (another server holds it, "node" in the metadata),
  // NotFound, those of the store.
  virtual absl::StatusOr<int64_t> Acquire(const std::string& id) = 0;

  // The epoch to write under; none when this server may not answer (any longer). Fast, never
  // blocks.
  virtual std::optional<int64_t> EpochOf(const std::string& id) = 0;

  // Its record is gone: nothing is held of it, nor of the next one of its id. Never blocks.
  virtual void Forget(const std::string& id) = 0;

  // Others may take it at once. Blocks on the store; nothing happens where it is not held.
  virtual void Release(const std::string& id) = 0;
};

// All are this server's.
class SoleOwnership final : public SessionOwnership {
 public:
  bool is_shared() const override { return false; }
  absl::StatusOr<int64_t> Acquire(const std::string& /*id*/) override { return kSoleEpoch; }
  std::optional<int64_t> EpochOf(const std::string& /*id*/) override { return kSoleEpoch; }
  void Forget(const std::string& /*id*/) override {}
  void Release(const std::string& /*id*/) override {}

  // Has no state.
  static SoleOwnership* Get() {
    static SoleOwnership ownership;
    return &ownership;
  }
};

}  // namespace tissueform
