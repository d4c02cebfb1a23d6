// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "server/store/stores.h"

namespace tissueform {

// One form of the stores, for tests that all of them pass.
struct StoresCase {
  std::string name;
  // Empty ones, which leave nothing behind.
  std::function<std::unique_ptr<Stores>(UnixClock clock)> make;
};

inline void PrintTo(const StoresCase& stores_case, std::ostream* out) { *out << stores_case.name; }

// Those of this test program: the contract's tests are in that of server/store and once more in
// that of server/store/postgres_store.
std::vector<StoresCase> AllStores();

// A new private folder for a test, which goes with this object.
class ScratchFolder {
 public:
  ScratchFolder();
  // Below `parent`, or where the others are when it is not there.
  explicit ScratchFolder(const std::string& parent);
  ~ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;

  const std::string& path() const { return path_; }
  std::string operator/(const std::string& name) const { return path_ + "/" + name; }

 private:
  std::string path_;
};

}  // namespace tissueform
