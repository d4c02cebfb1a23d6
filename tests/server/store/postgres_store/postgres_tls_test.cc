// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <filesystem>
#include <string>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "server/store/postgres_store/postgres_stores.h"
#include "tests/server/store/postgres_store/test_database.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_authority.h"

// TLS to a database that has it.
namespace tissueform::testing {
namespace {

using ::testing::AnyOf;
using ::testing::HasSubstr;
using Code = absl::StatusCode;

class PostgresTlsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    TF_SKIP_WITHOUT_DATABASE();
    EmptyTestDatabase();
    folder_ = EmptyTestFolder("postgres_tls");
    WriteTestFile(folder_ / "ca.pem", authority_.certificate());
    WriteTestFile(folder_ / "other-ca.pem", TestAuthority("Another").certificate());
  }
  void TearDown() override {
    if (!HasTestDatabase()) return;
    for (const char* setting : {"ssl", "ssl_cert_file", "ssl_key_file"}) {
      RunOutsideTransaction(absl::StrCat("ALTER SYSTEM RESET ", setting));
    }
    Reload();
  }

  // Written by the database itself, so that they are its user's.
  static void WriteAtDatabase(const std::string& name, const std::string& pem) {
    RunSql(absl::StrCat("COPY (SELECT regexp_split_to_table('", pem,
                        "', chr(10))) TO PROGRAM 'umask 077; cat > ", name, "'"));
  }
  static void Reload() { RunSql("SELECT pg_reload_conf()::int"); }

  void UseCertificate(const TestCertificate& content) {
    const TestIdentity identity = authority_.Issue(content);
    WriteAtDatabase("tissueform.pem", identity.certificate);
    WriteAtDatabase("tissueform.key", identity.key);
    for (const char* change :
         {"ssl_cert_file = 'tissueform.pem'", "ssl_key_file = 'tissueform.key'", "ssl = on"}) {
      RunOutsideTransaction(absl::StrCat("ALTER SYSTEM SET ", change));
    }
    Reload();
  }

  absl::Status Open(const std::string& host, const std::string& roots) {
    PostgresOptions options = TestDatabaseOptions();
    options.url =
        absl::StrCat("postgresql://postgres@", host, ":", TestDatabasePort(),
                     "/postgres?sslmode=verify-full&sslrootcert=", (folder_ / roots).string());
    return PostgresStores::Open({.database = options}).status();
  }
  // The database takes its new settings a moment after it was asked to.
  absl::Status OpenWhenTaken() {
    absl::Status status;
    for (int i = 0; i < 3'000; ++i) {
      status = Open("localhost", "ca.pem");
      if (status.ok()) break;
    }
    return status;
  }

  const TestAuthority authority_;
  std::filesystem::path folder_;
};

TEST_F(PostgresTlsTest, TheDatabasesCertificateIsAskedForAndRead) {
  UseCertificate({.name = "localhost"});
  ASSERT_THAT(OpenWhenTaken(), IsOk());
  EXPECT_THAT(Open("localhost", "other-ca.pem"),
              StatusIs(Code::kUnavailable, HasSubstr("certificate")))
      << "of an authority that is not ours";
  PostgresOptions plain = TestDatabaseOptions();
  absl::StrAppend(&plain.url, "?sslmode=disable");
  EXPECT_THAT(PostgresStores::Open({.database = plain}).status(), IsOk())
      << "who says so goes without";
}

TEST_F(PostgresTlsTest, ACertificateOfAnotherHostIsRefused) {
  UseCertificate({.name = "localhost"});
  ASSERT_THAT(OpenWhenTaken(), IsOk());
  UseCertificate({.name = "elsewhere.example", .alternatives = "DNS:elsewhere.example"});
  absl::Status status;
  for (int i = 0; i < 3'000 && !absl::IsUnavailable(status); ++i) {
    status = Open("localhost", "ca.pem");
  }
  EXPECT_THAT(status, StatusIs(Code::kUnavailable,
                               AnyOf(HasSubstr("host name"), HasSubstr("elsewhere.example"))));
}

TEST_F(PostgresTlsTest, RefusesADatabaseWithoutTls) {
  RunOutsideTransaction("ALTER SYSTEM SET ssl = off");
  Reload();
  absl::Status status;
  for (int i = 0; i < 3'000; ++i) {
    status = Open("localhost", "ca.pem");
    if (absl::StrContains(std::string(status.message()), "does not support SSL")) break;
  }
  EXPECT_THAT(status, StatusIs(Code::kUnavailable, HasSubstr("does not support SSL")));
}

}  // namespace
}  // namespace tissueform::testing
