// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/tls_options.h"

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr absl::StatusCode kRefused = absl::StatusCode::kFailedPrecondition;

TEST(TlsOptionsTest, LoopbackNeedsNeitherEncryptionNorLogins) {
  for (const char* host : {"127.0.0.1", "127.8.9.10", "::1", "localhost"}) {
    EXPECT_THAT(CheckExposure(host, {}, false), IsOk()) << host;
  }
}

TEST(TlsOptionsTest, OffLoopbackBothAreNeeded) {
  const TlsOptions tls = {.certificate = "a", .key = "b"};
  for (const char* host : {"0.0.0.0", "::", "192.0.2.1"}) {
    EXPECT_THAT(CheckExposure(host, {}, false),
                StatusIs(kRefused, AllOf(HasSubstr("--tls-cert"), HasSubstr("--token-issuer"))));
    EXPECT_THAT(CheckExposure(host, tls, false), StatusIs(kRefused, HasSubstr("logins")));
    EXPECT_THAT(CheckExposure(host, {}, true), StatusIs(kRefused, HasSubstr("without encryption")));
    EXPECT_THAT(CheckExposure(host, tls, true), IsOk());
  }
}

TEST(TlsOptionsTest, InsecureOptionAllowsExposure) {
  EXPECT_THAT(CheckExposure("0.0.0.0", {.insecure = true}, false), IsOk());
}

TEST(TlsOptionsTest, HalfOfAnIdentityIsRefused) {
  EXPECT_THAT(CheckExposure("127.0.0.1", {.certificate = "a"}, false), StatusIs(kInvalid));
  EXPECT_THAT(CheckExposure("127.0.0.1", {.client_ca = "a"}, false), StatusIs(kInvalid));
}

}  // namespace
}  // namespace tissueform::testing
