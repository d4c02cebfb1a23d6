// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/postgres_store/postgres_options.h"

#include <cstdlib>
#include <fstream>
#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <sys/stat.h>

#include "server/store/postgres_store/lease_keeper.h"
#include "server/store/postgres_store/session_leases.h"
#include "tests/server/store/stores_case.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::tissueform::testing::IsOk;
using ::tissueform::testing::StatusIs;
using Code = absl::StatusCode;

PostgresOptions Url(const std::string& url) { return {.url = url, .password = ""}; }

TEST(PostgresOptionsTest, AUrlBecomesKeywordsAndANameForMessages) {
  PostgresOptions options = Url("postgresql://ann@db.example:5433/faces");
  options.password = "it's a \\secret";
  ASSERT_OK_AND_ASSIGN(const PostgresTarget target, TargetOf(options));
  EXPECT_EQ(target.name, "postgresql://db.example:5433/faces");
  EXPECT_THAT(
      target.connection,
      AllOf(HasSubstr("host='db.example'"), HasSubstr("dbname='faces'"), HasSubstr("user='ann'"),
            HasSubstr("password='it\\'s a \\\\secret'"), HasSubstr("statement_timeout=20000"),
            HasSubstr("idle_in_transaction_session_timeout=3000"),
            HasSubstr("target_session_attrs='read-write'"), HasSubstr("tcp_user_timeout='10000'")));
}

TEST(PostgresOptionsTest, LocksOfAStoppedServerAreFreeBeforeItsLeasesEnd) {
  // Renewed just before, for the last time.
  EXPECT_LT(PostgresOptions().idle_timeout,
            LeaseOptions().duration - LeaseKeeper::Options().renew_every);
}

TEST(PostgresOptionsTest, VerifiesRemoteHostsUnlessTheUrlSaysOtherwise) {
  ASSERT_OK_AND_ASSIGN(PostgresTarget target, TargetOf(Url("postgresql://db.example/faces")));
  EXPECT_THAT(target.connection, HasSubstr("sslmode='verify-full'"));
  ASSERT_OK_AND_ASSIGN(target, TargetOf(Url("postgresql://localhost,db.example/faces")));
  EXPECT_THAT(target.connection, HasSubstr("sslmode='verify-full'"));
  ASSERT_OK_AND_ASSIGN(target, TargetOf(Url("postgresql://localhost/faces")));
  EXPECT_THAT(target.connection, Not(HasSubstr("verify-full")));
  ASSERT_OK_AND_ASSIGN(target, TargetOf(Url("postgresql://localhost/f?hostaddr=192.0.2.1")));
  EXPECT_THAT(target.connection, HasSubstr("sslmode='verify-full'")) << "a name is no address";
  ASSERT_OK_AND_ASSIGN(target, TargetOf(Url("postgresql://db.example/faces?sslmode=disable")));
  EXPECT_THAT(target.connection, HasSubstr("sslmode='disable'"));
  for (const char* mode : {"allow", "prefer", "verify"}) {
    EXPECT_THAT(TargetOf(Url(std::string("postgresql://db.example/f?sslmode=") + mode)),
                StatusIs(Code::kInvalidArgument, HasSubstr("verify-full")));
  }
}

TEST(PostgresOptionsTest, RefusesInvalidUrlsWithoutRepeatingThem) {
  for (const char* url :
       {"", "data/folder", "host=db.example password=hush", "http://hush",
        "postgresql://ann:hush@db.example/faces", "postgresql://db.example/faces?password=hush",
        "postgresql://db.example/faces?hush=1", "postgresql://%zzhush"}) {
    EXPECT_THAT(TargetOf(Url(url)), StatusIs(Code::kInvalidArgument, Not(HasSubstr("hush"))))
        << url;
  }
  PostgresOptions options = Url("postgresql://db.example/faces");
  options.max_connections = 0;
  EXPECT_THAT(TargetOf(options), StatusIs(Code::kInvalidArgument, HasSubstr("at least 1")));
}

TEST(PostgresOptionsTest, PasswordComesFromAPrivateFileOrTheEnvironment) {
  const ScratchFolder folder;
  const std::string path = folder / "password";
  std::ofstream(path) << "hush\n";
  ASSERT_EQ(chmod(path.c_str(), 0600), 0);
  ASSERT_OK_AND_ASSIGN(std::string password, ReadPostgresPassword(path));
  EXPECT_EQ(password, "hush");
  ASSERT_EQ(chmod(path.c_str(), 0604), 0);
  EXPECT_THAT(ReadPostgresPassword(path),
              StatusIs(Code::kFailedPrecondition, HasSubstr("chmod o-rwx")));
  EXPECT_THAT(ReadPostgresPassword(folder / "missing"), StatusIs(Code::kNotFound));
  ASSERT_EQ(setenv("TISSUEFORM_STORE_PASSWORD", "other", 1), 0);
  ASSERT_OK_AND_ASSIGN(password, ReadPostgresPassword(""));
  EXPECT_EQ(password, "other");
  ASSERT_EQ(unsetenv("TISSUEFORM_STORE_PASSWORD"), 0);
  ASSERT_OK_AND_ASSIGN(password, ReadPostgresPassword(""));
  EXPECT_EQ(password, "");
}

}  // namespace
}  // namespace tissueform
