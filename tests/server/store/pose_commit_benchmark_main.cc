// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"

#include "core/base/percentiles.h"
#include "core/base/status_macros.h"
#include "core/base/stopwatch.h"
#include "server/platform/storage/database.h"
#include "server/store/access_queries.h"
#include "server/store/durable_store.h"
#include "server/store/postgres_store/postgres_options.h"
#include "server/store/postgres_store/postgres_stores.h"
#include "server/store/sql_access_store.h"
#include "tests/server/store/store_samples.h"
#include "tests/server/store/waiting_calls.h"

// What the commit of a pose costs beside a bare commit of SQLite, in one run and in turns; prints
// the medians and their ratio. And what the question of who may use a session costs.
//
//   tissueform-store-benchmark FOLDER [COMMITS [URL]]
//
// in a new folder below FOLDER, on the disk to ask. URL: also asks an empty PostgreSQL database;
// its password is in the environment variable TISSUEFORM_STORE_PASSWORD.
namespace tissueform {
namespace {

constexpr int kSessions = 32;

// As large as the record of the bundled head: a commit of poses must not write it.
SessionRecord HeadSession(int number) {
  SessionRecord record = SampleSession(absl::StrCat("s", number), number);
  record.node_order.resize(22'000);
  std::iota(record.node_order.begin(), record.node_order.end(), 0);
  record.fixed = record.node_order;
  return record;
}

int Fail(const absl::Status& status) {
  std::fprintf(stderr, "tissueform-store-benchmark: %s\n", status.ToString().c_str());
  return EXIT_FAILURE;
}

// One row of one table, changed by every commit.
absl::StatusOr<std::unique_ptr<Database>> OpenBare(const std::string& path) {
  auto bare = Database::Open(path);
  if (!bare.ok()) return bare;
  const absl::Status status = (*bare)->Execute(
      "CREATE TABLE numbers (key INTEGER PRIMARY KEY, value INTEGER) STRICT; INSERT INTO numbers "
      "VALUES (1, 0)");
  if (!status.ok()) return status;
  return bare;
}

absl::Status AddSessions(Stores& stores) {
  for (int number = 0; number < kSessions; ++number) {
    const SessionRecord record = HeadSession(number);
    TF_RETURN_IF_ERROR(CreateSession(stores.sessions(), record).status());
    TF_RETURN_IF_ERROR(SqlAccessStore(&stores.database())
                           .PutShare({.resource = absl::StrCat("sessions/", record.id),
                                      .owner = record.owner,
                                      .principal = "bob"},
                                     /*most=*/1));
  }
  return absl::OkStatus();
}

absl::Status MeasureAccess(const char* driver, SqlDatabase* database, int questions) {
  AccessQueries queries(database);
  std::vector<double> micros;
  for (int question = 0; question < questions; ++question) {
    Stopwatch watch;
    const auto found = queries.FindSession(absl::StrCat("s", question % kSessions), "bob");
    micros.push_back(watch.Restart() * 1e6);
    TF_RETURN_IF_ERROR(found.status());
  }
  std::printf("may they?     p50 %.1f us  p99 %.1f us  %s\n", Median(micros),
              Percentile(micros, 99), driver);
  return absl::OkStatus();
}

absl::Status MeasurePostgres(const std::string& url, int questions) {
  TF_ASSIGN_OR_RETURN(const std::string password, ReadPostgresPassword(""));
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<PostgresStores> stores,
                      PostgresStores::Open({.database = {.url = url, .password = password}}));
  for (int number = 0; number < kSessions; ++number) {
    const MeshPayload payload = SamplePayload(number);
    TF_RETURN_IF_ERROR(stores->meshes().Put(RecordOf(payload), payload.View()));
  }
  TF_RETURN_IF_ERROR(AddSessions(*stores));
  return MeasureAccess("PostgreSQL", &stores->database(), questions);
}

int Run(const std::string& folder, int commits, const std::string& url) {
  const auto bare = OpenBare(folder + "/bare.db");
  if (!bare.ok()) return Fail(bare.status());
  auto data = DataFolder::Open(folder + "/data");
  if (!data.ok()) return Fail(data.status());
  const auto store = DurableStore::Open(*std::move(data));
  if (!store.ok()) return Fail(store.status());
  SessionStore& sessions = (*store)->sessions();
  if (const absl::Status added = AddSessions(**store); !added.ok()) return Fail(added);
  std::vector<double> bare_ms;
  std::vector<double> pose_ms;
  for (int commit = 0; commit < commits; ++commit) {
    Stopwatch watch;
    absl::Status status =
        (*bare)->Prepare("UPDATE numbers SET value = ? WHERE key = 1").Bind(int64_t{commit}).Run();
    bare_ms.push_back(watch.Restart() * 1e3);
    if (!status.ok()) return Fail(status);
    status = CommitPoses(sessions, absl::StrCat("s", commit % kSessions), SamplePoses(commit));
    pose_ms.push_back(watch.Restart() * 1e3);
    if (!status.ok()) return Fail(status);
  }
  std::printf("bare commit   p50 %.3f ms  p99 %.3f ms\n", Median(bare_ms), Percentile(bare_ms, 99));
  std::printf("pose commit   p50 %.3f ms  p99 %.3f ms\n", Median(pose_ms), Percentile(pose_ms, 99));
  std::printf("ratio of p50  %.2f\n", Median(pose_ms) / Median(bare_ms));
  absl::Status measured = MeasureAccess("SQLite", &(*store)->database(), commits);
  if (measured.ok() && !url.empty()) measured = MeasurePostgres(url, commits);
  return measured.ok() ? EXIT_SUCCESS : Fail(measured);
}

}  // namespace
}  // namespace tissueform

int main(int argc, char** argv) {
  int commits = 2000;
  if (argc < 2 || argc > 4 || (argc > 2 && (!absl::SimpleAtoi(argv[2], &commits) || commits < 1))) {
    std::fprintf(stderr, "usage: tissueform-store-benchmark FOLDER [COMMITS [URL]]\n");
    return EXIT_FAILURE;
  }
  std::string folder = std::string(argv[1]) + "/store-benchmark-XXXXXX";
  if (mkdtemp(folder.data()) == nullptr) {
    std::perror("tissueform-store-benchmark");
    return EXIT_FAILURE;
  }
  const int result = tissueform::Run(folder, commits, argc > 3 ? argv[3] : "");
  std::filesystem::remove_all(folder);
  return result;
}
